"""Precomputed radiance transfer: how a mesh shadows itself and lights itself, vertex by vertex."""
