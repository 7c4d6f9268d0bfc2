"""Tests. They run with one thread for BLAS, as `shrm` itself does.

The variables must be set before numpy is imported, so it happens here and not in `conftest.py`.
"""

from shrm_cli.settings import limit_small_products

limit_small_products()
