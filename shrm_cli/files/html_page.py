"""Pages of HTML that hold all they need: one file, which nothing of a network can get into.

A page can be opened from a disk. Its policy (Content-Security-Policy) allows no other script and
style than its own, which it names by their digests, and no way to the network.
"""

import base64
import hashlib
import html
from functools import cache
from importlib import resources

from shrm_cli import __release__


@cache
def asset(folder: str, name: str) -> str:
    """Return the text of a file in the folder ``assets`` of a folder of the package."""
    found = resources.files(f"shrm_cli.{folder}").joinpath("assets", name)
    return found.read_text(encoding="utf-8")


def digest(text: str) -> str:
    """Return the digest of a script or a style, as policies name it."""
    found = hashlib.sha256(text.encode("utf-8")).digest()
    return f"'sha256-{base64.b64encode(found).decode('ascii')}'"


def html_page(
    title: str,
    body: str,
    style: str,
    script: str = "",
    *,
    network: str = "'none'",
    framed: tuple[str, str] = ("", ""),
) -> str:
    """Return a page: HTML, to be written as UTF-8.

    `title` is any text; it is escaped. `body` is HTML, in which all text has been escaped. `style`
    and `script` are what stands in the page. Neither may hold the end of its element. `network` is
    what the page may ask for, as `connect-src` of its policy has it. `framed` holds digests of
    scripts and styles of pages that are framed in it: they obey its policy besides their own.
    """
    scripts = " ".join(filter(None, [digest(script) if script else "", framed[0]])) or "'none'"
    styles = " ".join(filter(None, [digest(style), framed[1]]))
    policy = (
        f"default-src 'none'; script-src {scripts}; style-src {styles}; img-src blob: data:; "
        f"connect-src {network}; base-uri 'none'; form-action 'none'"
    )
    return "\n".join(
        [
            "<!DOCTYPE html>",
            '<html lang="en">',
            "<head>",
            '<meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{policy}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            '<meta name="referrer" content="no-referrer">',
            f'<meta name="generator" content="shrm {html.escape(__release__)}">',
            f"<title>{html.escape(title)}</title>",
            '<link rel="icon" href="data:,">',
            f"<style>{style}</style>",
            "</head>",
            "<body>",
            body,
            *([f"<script>{script}</script>"] if script else []),
            "</body>",
            "</html>",
            "",
        ]
    )
