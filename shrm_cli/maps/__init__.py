"""Maps of reflected light: what all of them have in common, and a folder for each kind of map."""
