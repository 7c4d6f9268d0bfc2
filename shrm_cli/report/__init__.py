"""Pages of one file about a probe and its maps, and about many maps."""
