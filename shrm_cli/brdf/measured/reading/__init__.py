"""What formats of measured BRDFs need: readers of files, and the mathematics of their contents."""
