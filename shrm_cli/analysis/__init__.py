"""What orders capture of BRDFs, and of the light that they reflect."""
