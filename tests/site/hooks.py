"""What MkDocs calls while it builds the site: pages that are made, and pages outside of docs/.

The reference of commands comes from click and that of Python from docstrings, so that no text of
theirs is written twice. mkdocs.yml names this file.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

import shrm_cli
from tests.site.reference import command_pages, python_page

ROOT = Path(__file__).parents[2]
OUTSIDE = ("CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md")
"""Pages of the root of the repository that are pages of the site."""
PACKAGES = ROOT / "tests" / "site" / "node_modules"
KATEX = PACKAGES / "katex" / "dist"
GALLERY = ROOT / "build" / "gallery"
"""What `make gallery` leaves; a site that is built without it has no such page."""


def on_config(config: Any) -> Any:
    """Add the pages of commands to the navigation, and the gallery if there is one."""
    if (GALLERY / "gallery.md").exists():
        next(part["Start"] for part in config.nav if "Start" in part).append("gallery.md")
    (reference,) = (part["Reference"] for part in config.nav if "Reference" in part)
    pages = [f"reference/commands/{name}.md" for name, _ in command_pages()]
    reference.append({"Commands": pages})
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that are made, and the files that pages link to."""

    def add(name: str, content: str) -> None:
        files.append(File.generated(config, name, content=content))

    def copy(name: str, source: Path) -> None:
        files.append(File.generated(config, name, abs_src_path=str(source)))

    add("reference/python.md", python_page(shrm_cli._HOMES))
    for name, text in command_pages():
        add(f"reference/commands/{name}.md", text)
    for name in OUTSIDE:
        text = (ROOT / name).read_text(encoding="utf-8")
        add(name, text.replace("](docs/", "]("))
    copy("CITATION.cff", ROOT / "CITATION.cff")
    examples = ROOT / "examples"
    for path in (*sorted(examples.rglob("*.py")), examples / "plugin" / "pyproject.toml"):
        copy(path.relative_to(ROOT).as_posix(), path)
    scripts = [KATEX / name for name in ("katex.min.css", "katex.min.js")]
    scripts.append(KATEX / "contrib" / "auto-render.min.js")
    for path in (*scripts, *sorted((KATEX / "fonts").glob("*.woff2"))):
        copy(f"katex/{path.relative_to(KATEX).as_posix()}", path)
    copy("iframe-worker/index.js", PACKAGES / "iframe-worker" / "shim" / "index.js")
    for path in sorted(GALLERY.glob("*")):
        copy(path.name if path.suffix == ".md" else f"gallery/{path.name}", path)
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Turn links that leave docs/ on a page of it to the copies within the site."""
    return re.sub(r"\]\(((?:\.\./)*)\.\./(?=CITATION|examples|[A-Z]+\.md)", r"](\1", markdown)
