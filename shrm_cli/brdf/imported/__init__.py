"""Materials of other programs, read as OpenPBR's surface. Each module but `file` is one format."""
