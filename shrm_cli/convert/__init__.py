"""Maps and probes made into others, and into plain images and textures, without prefiltering."""
