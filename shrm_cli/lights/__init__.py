"""The lamps of a probe: found, taken out of it, and written as lights of other programs."""
