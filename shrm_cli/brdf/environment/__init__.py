"""What GGX and other BRDFs reflect of a whole environment: lobes, albedos, moments, tables."""
