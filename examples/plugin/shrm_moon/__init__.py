"""A BRDF, a command, an engine, a form and a reader for shrm; each is imported when it is named."""
