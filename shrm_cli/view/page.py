"""Pages of one file: markup, style, scripts and data, and nothing from anywhere else.

A page can be opened from a disk. Its policy (Content-Security-Policy) allows no other script than
its own, which it names by its digest, and no way to the network.
"""

import base64
import hashlib
import html
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

from shrm_cli.geometry.mesh import Mesh
from shrm_cli.maps.base import Map
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress
from shrm_cli.view.scene import Scene, Start, Truth, make_scene

SCRIPTS = (
    "data", "camera", "gl", "shaders", "renderer", "screen", "viewer", "controls", "input", "start",
)  # fmt: skip
"""The scripts in `assets/`, in the order in which they are joined into one."""

_FULL = "html, body { height: 100%; margin: 0; }\n"


@dataclass(frozen=True)
class Section:
    """A view of maps as parts of a page; a page holds one style and one script for all views.

    Attributes
    ----------
    style : str
        CSS, all of it below the class ``shrm-view``.
    body : str
        An element of that class, with its data in it. It is as high as what it stands in.
    script : str
        JavaScript for the end of the page. It makes views of all elements of the class.
    """

    style: str
    body: str
    script: str


@cache
def _asset(name: str) -> str:
    return resources.files("shrm_cli.view").joinpath("assets", name).read_text(encoding="utf-8")


def _script() -> str:
    """Return all scripts as one function, which leaves nothing but `window.shrm` behind."""
    code = "\n".join(_asset(f"{name}.js") for name in SCRIPTS)
    return f'(function () {{\n"use strict";\n\n{code}}})();\n'


def section(scene: Scene, urls: Sequence[str] | None = None) -> Section:
    """Return a scene as parts of a page.

    Parameters
    ----------
    scene : Scene
    urls : sequence of str, optional
        Where the page finds each block; by default the blocks stand in the page itself.
    """
    described = {
        **scene.description,
        "blocks": [{"url": url} for url in urls or [""] * len(scene.blocks.parts)],
    }
    data = [f'<script type="application/json" class="shrm-scene">{embedded(described)}</script>']
    for block in scene.blocks.encoded() if urls is None else []:
        data.append(f'<script type="text/plain" class="shrm-block">{block}</script>')
    start, end = _asset("body.html").rsplit("</div>", 1)
    body = "\n".join([start.rstrip(), *data, f"</div>{end}"])
    return Section(_asset("page.css"), body, _script())


def sources() -> tuple[str, str]:
    """Return what the policy of a page has to allow that frames pages of views: script and style.

    Pages within a page obey its policy besides their own.
    """
    return digest(_script()), digest(_FULL + _asset("page.css"))


def page(scene: Scene, urls: Sequence[str] | None = None) -> str:
    """Return a scene as a whole page.

    Parameters
    ----------
    scene : Scene
    urls : sequence of str, optional
        As `section` takes them.

    Returns
    -------
    str
        HTML, to be written as UTF-8.
    """
    parts = section(scene, urls)
    style = _FULL + parts.style
    network = "'none'" if urls is None else "'self'"
    script_source, style_source = sources()
    policy = (
        f"default-src 'none'; script-src {script_source}; style-src {style_source}; "
        f"img-src blob: data:; connect-src {network}; "
        "base-uri 'none'; form-action 'none'"
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
            f"<title>{html.escape(scene.description['title'])} \u2013 shrm</title>",
            '<link rel="icon" href="data:,">',
            f"<style>{style}</style>",
            "</head>",
            "<body>",
            parts.body,
            f"<script>{parts.script}</script>",
            "</body>",
            "</html>",
            "",
        ]
    )


def view_page(
    maps: Sequence[Map],
    files: Sequence[str],
    probe: Probe | None = None,
    mesh: Mesh | None = None,
    start: Start | None = None,
    truth: Truth | None = None,
    max_size: int | None = None,
    progress: Progress | None = None,
) -> str:
    """Return a page that shows maps; all arguments are those of `make_scene`.

    Returns
    -------
    str
        HTML of one file, to be written as UTF-8.
    """
    return page(make_scene(maps, files, probe, mesh, start, truth, max_size, progress))


def embedded(value: Any) -> str:
    """Return JSON that can stand in an element of a page, whatever texts it holds.

    Names of files may hold ``</script>`` or ``<!--``, which must not end the element.
    """
    text = json.dumps(value, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    for sign in "<>&":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return text


def digest(text: str) -> str:
    """Return a text's digest as policies name it."""
    found = hashlib.sha256(text.encode("utf-8")).digest()
    return f"'sha256-{base64.b64encode(found).decode('ascii')}'"
