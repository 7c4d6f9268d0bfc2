"""Explicit (tabular) maps: Cabral, Kautz and McCool, light fields."""
