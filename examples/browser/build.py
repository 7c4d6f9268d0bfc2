"""Put the page, Python for browsers, numpy and shrm into a folder that any web server can serve.

    python examples/browser/build.py NODE_MODULES FOLDER

NODE_MODULES holds the npm packages pyodide, @emscripten-forge/numpy, three and esbuild, at the
versions of tests/web/package-lock.json.
"""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
PACKAGE = HERE.parents[1] / "shrm_cli"
PYODIDE = (
    "pyodide.js", "pyodide.asm.js", "pyodide.asm.wasm", "pyodide-lock.json", "python_stdlib.zip"
)  # fmt: skip
OURS = "index.html", "worker.js", "prefilter.py"


def build(modules: Path, folder: Path) -> None:
    """Write all files of the page into a folder, which is made."""
    (folder / "pyodide").mkdir(parents=True, exist_ok=True)
    for name in PYODIDE:
        shutil.copy(modules / "pyodide" / name, folder / "pyodide" / name)
    for name in OURS:
        shutil.copy(HERE / name, folder / name)
    (archive,) = (modules / "@emscripten-forge" / "numpy" / "pkg").glob("numpy-*.tar.gz")
    shutil.copy(archive, folder / "numpy.tar.gz")
    with zipfile.ZipFile(folder / "shrm.zip", "w", zipfile.ZIP_DEFLATED) as packed:
        for path in sorted(PACKAGE.rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                packed.write(path, path.relative_to(PACKAGE.parent))
    subprocess.run(
        [
            modules / "esbuild" / "bin" / "esbuild", HERE / "page.js", "--bundle", "--minify",
            "--log-level=error", f"--outfile={folder / 'page.bundle.js'}",
        ],
        check=True,
        env={**os.environ, "NODE_PATH": os.fspath(modules)},
    )  # fmt: skip


if __name__ == "__main__":
    build(Path(sys.argv[1]), Path(sys.argv[2]))
    print(f"Serve it: python -m http.server -d {sys.argv[2]}")
