"""A BRDF, a command and an engine for shrm; each is imported only when it is named."""
