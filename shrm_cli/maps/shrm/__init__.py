"""Spherical harmonic reflection maps (SHRMs): making, compressing, summing and storing them."""
