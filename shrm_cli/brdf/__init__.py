"""Reflection models: what they are, how they are named, and their spherical harmonic coefficients.

`base` says what every BRDF answers. ``models`` holds the analytic ones, one file each, ``measured``
the file formats of measured ones, one file each, and ``environment`` what a uniform environment
makes of GGX. `spec` parses the text that names one, `coefficients` expands it, `cache` keeps that.
"""
