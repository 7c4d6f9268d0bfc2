"""What `make site`, `make figures` and `make gallery` need besides docs/."""
