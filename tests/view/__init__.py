"""Tests of the page of `shrm view` that need no browser."""
