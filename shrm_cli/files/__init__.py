"""How bytes get to disk, whole or not at all: OpenEXR files, images and pictures."""
