"""shrm: prefiltering of light probes for real materials in the frequency domain."""

__version__ = "0.1.0"
