"""What `make site` and `make gallery` need besides docs/: reference, figures, and gallery."""
