"""The errors that a user can cause or cure.

Each message is one line that says what is wrong, where, and what to do. Messages name arguments of
the library in backticks, such as `size`. The command line prints the flags in their place, such as
--size. Keys of files are in single quotes, such as 'size': no flag stands for them.
"""


class ShrmError(Exception):
    """The base class of all errors that the command `shrm` reports without a traceback."""


class ProbeError(ShrmError):
    """A light probe cannot be read, or its pixels cannot be used."""


class BrdfError(ShrmError):
    """A BRDF's specification or file is wrong, or the BRDF cannot be used as asked."""


class OrderError(ShrmError):
    """A tolerance cannot be met within the limits of the orders, or an order is outside them."""


class MapError(ShrmError):
    """A file is not a map that `shrm` wrote, or a map cannot be made or used as asked."""

    @classmethod
    def of_attribute(cls, path: str, name: str, what: str = "is missing or wrong") -> "MapError":
        """Return the error for a file whose attribute ``shrm:name`` is not as maps are written."""
        return cls(f"{path}: its attribute shrm:{name} {what}; make it again")


class TransferError(ShrmError):
    """A file is no precomputed transfer, or does not belong to what it is to be used with."""


class MeshError(ShrmError):
    """A mesh cannot be read, or cannot be drawn or traced as it is."""


class OutputError(ShrmError):
    """An output file cannot be written completely."""


class RemoteError(ShrmError):
    """A file that is not on this machine's disks cannot be listed, fetched or written."""


class ClusterError(ShrmError):
    """A cluster cannot be reached, or its workers cannot take part."""


class PluginError(ShrmError):
    """What an installed package adds to `shrm` cannot be loaded, or is not what it should be."""


class ArgumentError(ShrmError):
    """An argument has a value that it cannot have, or does not apply to what is asked for.

    The command line reports this error as wrong usage of the flag that belongs to the argument.

    Attributes
    ----------
    argument : str
        The name of the argument.
    """

    def __init__(self, argument: str, message: str) -> None:
        super().__init__(f"`{argument}` {message}")
        self.argument, self.message = argument, message

    def __reduce__(self) -> tuple[type["ArgumentError"], tuple[str, str]]:
        """How it comes out of worker processes, which break where an error cannot be pickled."""
        return type(self), (self.argument, self.message)


class ShrmWarning(UserWarning):
    """A remark of one line that the user should know about a result which is not wrong."""
