"""`shrm` begins here, as a command and as ``python -m shrm_cli``.

Loading the command line takes a tenth of a second, in which Ctrl-C would print a traceback.
"""

import signal
import sys
from types import FrameType


def main() -> None:
    """Run the command line and exit; see `shrm_cli.cli.main.main`."""
    listens = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if listens:  # a process in the background ignores it
        signal.signal(signal.SIGINT, _leave)
    from shrm_cli.cli.main import main as run

    if listens:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    run()


def _leave(number: int, frame: FrameType | None) -> None:
    if sys.stderr is not None:
        sys.stderr.write("\nError: interrupted\n")
    sys.exit(130)


if __name__ == "__main__":
    main()
