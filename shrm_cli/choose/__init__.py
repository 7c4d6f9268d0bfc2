"""Which form to ship: what every form of a probe and a material takes, and what it looks like."""
