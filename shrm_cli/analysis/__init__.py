"""Studies: what orders capture of BRDFs and of reflected light, and what representations cost."""
