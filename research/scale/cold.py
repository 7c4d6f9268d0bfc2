"""A `shrm` command that tells what its parts took: ``python -m research.scale.cold LIST ...``.

The first run writes the modules that it imported into the file LIST. Later runs import these one by
one before the command begins, so that no import counts as work.
"""

import importlib
import json
import sys
import time
from pathlib import Path

from research.scale.clock import REST, Clock


def main() -> None:
    """Run the command, and print the processor seconds of each part as JSON."""
    listing, arguments = Path(sys.argv[1]), sys.argv[2:]
    names = json.loads(listing.read_text()) if listing.exists() else []
    found = {"start": time.process_time()}
    for part in ("libraries", "shrm"):
        before = time.process_time()
        for name in names:
            if name.startswith("shrm_cli") == (part == "shrm"):
                importlib.import_module(name)
        found[part] = time.process_time() - before
    from shrm_cli.cli.main import main as command

    clock = Clock()
    with clock.watching(), clock.inside(REST):
        try:
            command(arguments)
        except SystemExit as stop:
            if stop.code:
                raise
    if not names:
        listing.write_text(json.dumps(_importable()))
    print(json.dumps({**found, **clock.seconds}))


def _importable() -> list[str]:
    """Return the names of the modules that are there, and have files."""
    return [
        name
        for name, module in sys.modules.items()
        if getattr(module, "__spec__", None) and name != "__main__" and "tests" not in name
    ]


if __name__ == "__main__":
    main()
