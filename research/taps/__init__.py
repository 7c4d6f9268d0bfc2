"""The program of `make taps`: fits the taps of brushed GGX, and measures what they miss."""
