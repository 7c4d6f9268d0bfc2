"""The errors that a user can cause or cure. Each message is one line: what, where, what to do."""


class ShrmError(Exception):
    """Base of every error that `shrm` reports without a traceback."""


class ProbeError(ShrmError):
    """A light probe cannot be read, or its pixels cannot be used."""


class BrdfError(ShrmError):
    """A BRDF specification names no model, or a parameter is out of its range."""


class OrderError(ShrmError):
    """A tolerance or an order cannot be met within the limits."""


class MapError(ShrmError):
    """A file is not a map that `shrm` wrote, or a map cannot be used as asked."""


class OutputError(ShrmError):
    """An output file cannot be written whole."""
