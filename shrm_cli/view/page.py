"""The page of a scene: markup, style, scripts and data in one file."""

import json
from collections.abc import Sequence
from typing import Any

from shrm_cli.files.html_page import asset, digest, html_page
from shrm_cli.records import record
from shrm_cli.view.scene import Scene

SCRIPTS = (
    "data", "camera", "gl", "shaders", "renderer", "screen", "viewer", "controls", "input", "start",
)  # fmt: skip
"""The scripts in `assets/`, in the order in which they are joined into one."""

_FULL = "html, body { height: 100%; margin: 0; }\n"


@record
class Section:
    """A view of maps as parts of a page; a page holds one style and one script for all views."""

    style: str
    """CSS, all of it below the class ``shrm-view``."""
    body: str
    """An element of that class, with its data in it. It is as high as what it stands in."""
    script: str
    """JavaScript for the end of the page. It makes views of all elements of the class."""


def _script() -> str:
    """Return all scripts as one function, which leaves nothing but `window.shrm` behind."""
    code = "\n".join(asset("view", f"{name}.js") for name in SCRIPTS)
    return f'(function () {{\n"use strict";\n\n{code}}})();\n'


def section(scene: Scene, urls: Sequence[str] | None = None) -> Section:
    """Return a scene as parts of a page.

    `urls` say where the page finds each block; by default the blocks stand in the page itself.
    """
    widths = scene.blocks.widths
    described = {
        **scene.description,
        "blocks": [
            {"url": url, "width": width}
            for url, width in zip(urls or [""] * len(widths), widths, strict=True)
        ],
    }
    data = [f'<script type="application/json" class="shrm-scene">{embedded(described)}</script>']
    for block in scene.blocks.encoded() if urls is None else []:
        data.append(f'<script type="text/plain" class="shrm-block">{block}</script>')
    start, end = asset("view", "body.html").rsplit("</div>", 1)
    body = "\n".join([start.rstrip(), *data, f"</div>{end}"])
    return Section(asset("view", "page.css"), body, _script())


def sources() -> tuple[str, str]:
    """Return what the policy of a page has to allow that frames pages of views: script and style.

    Pages within a page obey its policy besides their own.
    """
    return digest(_script()), digest(_FULL + asset("view", "page.css"))


def page(scene: Scene, urls: Sequence[str] | None = None) -> str:
    """Return a scene as a whole page: HTML, to be written as UTF-8."""
    parts = section(scene, urls)
    return html_page(
        f"{scene.description['title']} \u2013 shrm",
        parts.body,
        _FULL + parts.style,
        parts.script,
        network="'none'" if urls is None else "'self'",
    )


def embedded(value: Any) -> str:
    """Return JSON that can stand in an element of a page, whatever texts it holds.

    Names of files may hold ``</script>`` or ``<!--``, which must not end the element.
    """
    text = json.dumps(value, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    for sign in "<>&":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return text
