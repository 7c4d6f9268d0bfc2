"""What GGX reflects of a whole environment: albedos, lobe moments and their tables."""
