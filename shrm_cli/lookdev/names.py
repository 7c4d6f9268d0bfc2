"""Short names of materials and probes, which stand beside the rows and columns of a sheet."""

from collections import Counter
from collections.abc import Sequence

from shrm_cli.brdf.nested import COMMA, cut
from shrm_cli.brdf.spec import file_label, names_file
from shrm_cli.brdf.sums import is_sum, term_texts
from shrm_cli.naming import probe_stem

_MOST = 24
"""Characters of a short name; longer ones end in an ellipsis."""


def material_names(specs: Sequence[str]) -> list[str]:
    """Return a short name for each specification of a BRDF, and no two alike.

    ``ggx:roughness=0.4,f0=gold`` is ``ggx 0.4 gold``, a measured file is its name without folder
    and suffix, and ``0.9*lambertian+0.1*ggx`` is ``lambertian + ggx``. Where that is the same for
    two of them, both keep all that they say.
    """
    return _told_apart([_short(spec) for spec in specs], [file_label(spec) for spec in specs])


def probe_names(paths: Sequence[str]) -> list[str]:
    """Return a short name for each probe: that of its file, with its folder where two are alike."""
    return _told_apart([probe_stem(path) for path in paths], paths)


def _told_apart(short: Sequence[str], full: Sequence[str]) -> list[str]:
    counts = Counter(short)
    return [name if counts[name] == 1 else text for name, text in zip(short, full, strict=True)]


def _short(spec: str) -> str:
    if is_sum(spec):
        return _cut(" + ".join(_short(term).partition(" ")[0] for term in term_texts(spec)))
    if names_file(spec):
        return _cut(file_label(spec))
    name, _, parameters = spec.partition(":")
    values = [pair.partition("=")[2] or pair for pair in cut(COMMA, parameters) if pair]
    words = (_short(value[1:-1]) if value[0] == "(" else value for value in map(str.strip, values))
    return _cut(" ".join([name.strip(), *words]))


def _cut(text: str) -> str:
    return text if len(text) <= _MOST else f"{text[: _MOST - 3]}..."
