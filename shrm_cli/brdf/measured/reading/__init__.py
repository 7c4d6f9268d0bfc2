"""What the readers of measured BRDFs share."""
