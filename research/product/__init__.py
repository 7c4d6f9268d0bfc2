"""The page on product textures: the figures and the table of Kautz, Sloan and Snyder 2002."""
