"""BRDF models, the syntax that names them, and their coefficients. One file a model."""
