"""Split sums: light prefiltered for some roughnesses, to be used with an environment-BRDF table."""
