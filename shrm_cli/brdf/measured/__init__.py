"""Measured BRDFs, one file a format."""
