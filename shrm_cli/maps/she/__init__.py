"""Spherical harmonic exponentials: glossy reflections from a few dozen coefficients."""
