"""BRDFs of surfaces in layers. Each module of this package is one layer over any base.

A layer is known by being here, as a model in `shrm_cli.brdf.models` is. What they have in common is
in ``parts``.
"""
