"""Analytic BRDFs, one file a model."""
