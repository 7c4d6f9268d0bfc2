"""Maps of reflected light, one file a representation."""
