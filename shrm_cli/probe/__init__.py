"""Image file -> Probe (radiance on a grid) -> Lighting (spherical harmonic coefficients)."""
