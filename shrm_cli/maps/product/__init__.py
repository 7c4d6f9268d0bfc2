"""BRDF product textures: tables of a BRDF's harmonics over directions of the view."""
