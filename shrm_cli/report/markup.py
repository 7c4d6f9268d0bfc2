"""HTML put together of elements. All text is escaped, whatever the names of files hold.

Nor does any of it let anybody in: a page is sent to others, with the command that made it.
"""

import html
from collections.abc import Iterable, Sequence

from shrm_cli.files.html_page import asset, html_page
from shrm_cli.messages import shown

_VOID = {"img"}


class Html(str):
    """Text that is HTML; every other text is escaped where it becomes part of a page."""


Part = str | Iterable["Part"]
"""HTML, text, or several of them."""


def joined(*parts: Part) -> Html:
    """Return parts as HTML, one after the other."""
    texts: list[str] = []
    for part in parts:
        if isinstance(part, Html):
            texts.append(part)
        elif isinstance(part, str):
            texts.append(_escaped(part))
        else:
            texts.append(joined(*part))
    return Html("".join(texts))


def tag(name: str, *parts: Part, **attributes: str) -> Html:
    """Return an element.

    `name` is one such as ``td``, or ``td.number`` with a class. `*parts` are what is in it. Values
    of `**attributes` are escaped; ``_`` in names stands for ``-``.
    """
    kind, _, of_class = name.partition(".")
    given = ({"class": of_class.replace(".", " ")} if of_class else {}) | attributes
    words = "".join(f' {key.replace("_", "-")}="{_escaped(value)}"' for key, value in given.items())
    if kind in _VOID:
        return Html(f"<{kind}{words}>")
    return Html(f"<{kind}{words}>{joined(*parts)}</{kind}>")


def spec(text: str) -> Html:
    """Return the specification of a BRDF, which lines may break after its commas."""
    first, *others = text.split(",")
    return tag("code", first, [joined(Html(",<wbr>"), each) for each in others])


def table(titles: Sequence[Part], rows: Iterable[Sequence[Part]], texts: int = 1) -> Html:
    """Return a table that scrolls by itself where a page is narrow.

    `titles` are those of the columns. `texts` is how many of the first columns hold text; the
    others hold numbers.
    """

    def line(kind: str, cells: Sequence[Part]) -> Html:
        kinds = [kind if k < texts else f"{kind}.number" for k in range(len(cells))]
        return tag("tr", [tag(*each) for each in zip(kinds, cells, strict=True)])

    head = tag("thead", line("th", titles))
    body = tag("tbody", [line("td", cells) for cells in rows])
    return tag("div.scroll", tag("table", head, body), tabindex="0")


def facts(pairs: Iterable[tuple[Part, Part]]) -> Html:
    """Return pairs of a word and a value as a list."""
    return tag("dl.facts", [tag("div", tag("dt", word), tag("dd", value)) for word, value in pairs])


def figure(picture: Html, *caption: Part) -> Html:
    """Return a picture with what it shows below."""
    return tag("figure", picture, tag("figcaption", *caption))


def details(summary: str, *parts: Part) -> Html:
    """Return what is shown when somebody asks for it."""
    return tag("details", tag("summary", summary), *parts)


def _escaped(text: str) -> str:
    return html.escape(shown(text))


def whole_page(title: str, *parts: Part, framed: tuple[str, str] = ("", "")) -> str:
    """Return a page, which holds all that it needs and reaches no network.

    `*parts` are what is in it. `framed` is as `html_page` takes it.
    """
    return html_page(title, tag("main", *parts), asset("report", "page.css"), framed=framed)
