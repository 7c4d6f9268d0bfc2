"""What `make site` and `make gallery` need besides docs/: the reference, figures, and the gallery."""
