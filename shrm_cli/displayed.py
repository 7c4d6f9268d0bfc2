"""What notebooks show of a probe or a map: the module that draws it is loaded when one asks."""

import importlib

_DRAWN_BY = "shrm_cli.notebook"


class Displayed:
    """The base of what notebooks show as a picture with numbers, see `shrm_cli.notebook`."""

    def _repr_html_(self) -> str:
        """Return what IPython shows at the end of a cell."""
        html: str = importlib.import_module(_DRAWN_BY).html(self)
        return html
