"""Explicit (tabular) maps: Cabral's maps, Kautz and McCool's texture, and light fields."""
