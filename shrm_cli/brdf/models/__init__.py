"""Analytic BRDFs. Each module of this package is one model, and its name that of the module.

A model is known by being here: `shrm_cli.brdf.library` finds it, and nothing else names it. Light L
and view V, the half vector H and the cosines N.L and N.V are in the frame of the normal N, whose z
axis is N, unless a model says otherwise.
"""
