"""Light probes from photographs: exposures, mirror balls, and lamps that were clipped."""
