"""The pixels of an image of the sphere: one module for each way to lay it out."""
