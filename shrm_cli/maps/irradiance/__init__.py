"""Irradiance environment maps: the light on diffuse surfaces, in a few lighting coefficients."""
