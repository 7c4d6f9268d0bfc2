"""Irradiance environment maps (chapter 4): a few lighting coefficients."""
