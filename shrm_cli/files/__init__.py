"""Files that are written whole or not at all: OpenEXR files, images and pictures."""
