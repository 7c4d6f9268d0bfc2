"""Spherical harmonic reflection maps: made, compressed, summed, stored."""
