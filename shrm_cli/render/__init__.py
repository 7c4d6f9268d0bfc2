"""Map, view and surroundings -> picture -> PNG or EXR."""
