"""Split sums: light prefiltered at some roughnesses, for a table of the environment-BRDF."""
