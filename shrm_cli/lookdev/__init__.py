"""Sheets of materials under probes: making the maps of all pairs, and showing them."""
