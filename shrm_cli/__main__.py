"""`shrm` begins here, as a command and as ``python -m shrm_cli``.

Loading the command line takes a tenth of a second, in which Ctrl-C would print a traceback.
"""

import atexit
import contextlib
import gc
import os
import signal
import sys
from types import FrameType

_GARBAGE = 100_000
"""The number of new objects after which Python looks for cycles among all objects; short runs make
50,000 to 75,000."""
_KEPT = 2**22
"""Bytes of memory; blocks of no more come from what was used before, as of then."""


def main() -> None:
    """Run the command line and exit; see `shrm_cli.cli.main.main`."""
    # Modules are full of objects that stay; looking through them for cycles took a twentieth of a
    # short run.
    gc.set_threshold(_GARBAGE)
    _keep_memory()
    listens = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if listens:  # a process in the background ignores it
        signal.signal(signal.SIGINT, _leave)
    _keep_bytecode()
    from shrm_cli.cli.main import main as run

    if listens:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        run()
    except SystemExit as stop:
        if isinstance(stop.code, int) and _is_told():
            # Python would free every object of every library first, a tenth of a short run.
            atexit._run_exitfuncs()
            os._exit(stop.code)
        raise


def _keep_memory() -> None:
    """Let arrays have memory that was used before.

    Once a block of this size was freed, glibc keeps smaller ones. Before, each array of more than
    128 kB is new pages from the system, which took three quarters of the time of `shrm dfg`.
    """
    bytes(_KEPT)


def _keep_bytecode() -> None:
    """Keep compiled modules where Python is told to keep none; see `shrm_cli.bytecode`."""
    if not sys.dont_write_bytecode:
        return
    import shrm_cli
    from shrm_cli import bytecode
    from shrm_cli.errors import OutputError
    from shrm_cli.settings import cache_folder

    with contextlib.suppress(OutputError):
        cache, compiled = str(cache_folder()), shrm_cli.__spec__.cached
        bytecode.keep(shrm_cli.__path__[0], compiled, cache)


def _is_told() -> bool:
    """Whether all that was printed has left the process; if not, Python tells why as it ends."""
    try:
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:
                stream.flush()
    except (OSError, ValueError):
        return False
    return True


def _leave(number: int, frame: FrameType | None) -> None:
    """End at once: nothing is begun, and importing drops exceptions in some of its callbacks."""
    if sys.stderr is not None:
        sys.stderr.write("\nError: interrupted\n")
        sys.stderr.flush()
    os._exit(130)


if __name__ == "__main__":
    main()
