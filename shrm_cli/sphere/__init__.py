"""The sphere and nothing else: no files, no light, no material."""
