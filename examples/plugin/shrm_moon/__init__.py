"""A BRDF, a command, an engine and a reader for shrm; each is imported only when it is named."""
