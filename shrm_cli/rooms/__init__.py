"""Rooms of diffuse surfaces: the light at many points within them, as probes on a lattice."""
