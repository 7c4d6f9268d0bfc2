"""What a map has to keep, and the search for the map of the fewest bytes that keeps it."""
