"""Install Chromium and the npm packages that `make web` and `make engines` need.

``python -m tests.web.install`` needs the standard library alone, and takes no time where all is
there. Debian's package manager installs Chromium where it may; npm installs package-lock.json.
``--packages`` leaves Chromium out, for `make browser`.
"""

import os
import re
import shutil
import subprocess
import sys

from tests.web import browser

_NODE = 18
"""The least version of Node.js that esbuild runs with."""


class Missing(Exception):
    """What is missing, and what to do, in a line."""


def check_npm():
    """Raise `Missing` where there is no npm, or a Node.js that is too old."""
    advice = f"install Node.js {_NODE} or newer with npm (Debian and Ubuntu: apt install npm)"
    for name in ("npm", "node"):
        if shutil.which(name) is None:
            raise Missing(f"there is no {name} on the path; {advice}")
    said = _run("node", "--version").stdout.strip()
    version = re.match(r"v(\d+)\.", said)
    if version is None or int(version[1]) < _NODE:
        raise Missing(f"Node.js {said} is too old; {advice}")


def install_chromium():
    """Install Debian's Chromium where there is none; raise `Missing` where that may not be."""
    named = os.environ.get("SHRM_CHROMIUM")
    if named:
        if shutil.which(named) is None:
            raise Missing(f"SHRM_CHROMIUM: there is no program {named!r}; name Chromium, or none")
        return
    if browser.chromium() is not None:
        return
    advice = "install it (Debian: apt install chromium), or name one in SHRM_CHROMIUM"
    sudo = [] if os.geteuid() == 0 else ["sudo", "-n"]
    if shutil.which("apt-get") is None or (sudo and not _may(*sudo)):
        raise Missing(f"there is no Chromium on the path; {advice}")
    print("Chromium is being installed: apt-get install chromium", flush=True)
    apt = [*sudo, "env", "DEBIAN_FRONTEND=noninteractive", "apt-get", "--yes"]
    _run(*apt, "update")
    done = _run(*apt, "install", "--no-install-recommends", "chromium")
    if browser.chromium() is None:
        raise Missing(f"apt-get could not install Chromium{_last(done)}; {advice}")


def install_packages():
    """Install what package-lock.json says, unless just that is there already."""
    if browser.complete():
        return
    check_npm()
    print(f"The engines are being installed into {browser.MODULES}: npm ci", flush=True)
    # No package's own scripts are run: none of these packages needs them.
    done = _run("npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund", cwd=browser.HERE)
    if done.returncode != 0:
        raise Missing(f"npm could not install the packages of package-lock.json{_last(done)}")
    shutil.copy(browser.HERE / "package-lock.json", browser.MODULES / ".complete.json")


def _may(*sudo):
    return shutil.which("sudo") is not None and _run(*sudo, "true").returncode == 0


def _run(*command, **options):
    return subprocess.run(
        command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False, **options
    )


def _last(done):
    """The first line of a program's that speaks of an error, as the end of a sentence's part."""
    lines = [line.strip() for line in done.stderr.splitlines() if line.strip()]
    wrong = [line for line in lines if re.match(r"E:|npm (ERR!|error)", line)] or lines[-1:]
    return f" ({wrong[-1]})" if wrong else ""


def main(*given):
    """Install all of it, or say in a line what is missing."""
    try:
        if not browser.complete():
            check_npm()  # before Chromium, which takes longer
        if "--packages" not in given:
            install_chromium()
        install_packages()
    except Missing as missing:
        sys.exit(f"Error: {missing}")


if __name__ == "__main__":
    main(*sys.argv[1:])
