"""Which texels an engine's cubes get: those that were asked for, or the smallest that will do."""

from collections.abc import Sequence
from types import ModuleType

import numpy as np

from shrm_cli.arrays import Array, slices
from shrm_cli.errors import ArgumentError, PluginError, ShrmError
from shrm_cli.export.blocks import astc, bc6h, uastc
from shrm_cli.export.blocks.lines import Found, with_lamps
from shrm_cli.export.engine import Engine, Light, Package
from shrm_cli.export.pixels import FORMATS, PICTURES, Loss, TexelFormat, Words
from shrm_cli.maps.options import counted
from shrm_cli.messages import explained
from shrm_cli.progress import in_order
from shrm_cli.vocabulary import ENGINES

MAX_ERROR = 0.03
"""The error that ``auto`` keeps where none is given."""
MAX_LAMP = 0.02
"""The most that the default texels of an engine may change a lamp that spare ones keep."""
SEEN_DIFFUSE, MAX_DIFFUSE = 0.05, 0.1
"""The 95th percentiles by which they change a last level that lights diffuse surfaces from which on
that is told, and from which on spare ones are taken, seven times as large. On balls, blocks of
UASTC HDR were seen as squares at .061 and more, and not at .043."""


def packed(engine: Engine, light: Light, name: str | None, max_error: float | None) -> Package:
    """Return the files of an engine, with texels that keep an error.

    `name` is that of the texels, or ``auto``; by default the engine's own, and its spare ones for
    light of which these alone lose what is seen. Where the engine has one format, that is what
    ``auto`` is, whatever it loses.
    """
    has_choice = len(engine.formats) > 1
    name = name if engine.formats else None
    limit = MAX_ERROR if name == "auto" and max_error is None and has_choice else max_error
    names = _candidates(engine, name)
    if limit is None:
        return _usual(engine, light, names)
    passed: list[str] = []
    least = np.inf
    for each in names:
        made = _pack(engine, light, ALL[each])
        worst = max(made.losses, key=lambda found: found.worst, default=None)
        if worst is None or worst.worst <= limit:
            if passed:
                made.told.append(f"{'; '.join(passed)}; {each} was written instead")
            return made
        passed.append(f"{each} {_change(worst)}")
        least = min(least, worst.worst)
    is_left = "rgba16f" in engine.formats and "rgba16f" not in names
    kept = f"{np.ceil(1e4 * least) / 1e4:g} is{', or give `format` rgba16f' if is_left else ''}"
    raise ArgumentError("max_error", f"{limit:g} is not kept: {'; '.join(passed)}; {kept}")


def _usual(engine: Engine, light: Light, names: list[str]) -> Package:
    """Return the files with the first texels, or with the spare ones where these keep more.

    What is beyond the range of both, both lose.
    """
    made = _pack(engine, light, ALL[names[0]])
    for spare in names[1:]:
        lost = _seen(engine, made.losses)
        if not lost:
            break
        other = _pack(engine, light, ALL[spare])
        left = {level.what for level in _seen(engine, other.losses)}
        mended = [level for level in lost if level.what not in left]
        if mended:
            # One level that is seen is reason enough: the numbers of five hide it.
            worst = max(mended, key=lambda level: level.lamp)
            more = f", and {counted(len(mended) - 1, 'more level')} too much"
            why = lost[worst] + (more if len(mended) > 1 else "")
            other.told.append(f"{names[0]} {why}; {spare} was written instead")
            return other
    squares = _squares(engine, made.losses, SEEN_DIFFUSE)
    if squares and ALL[names[0]].edge > 1:
        made.told.append(f"{names[0]} {squares}; rgba16f has none")
    return made


def _seen(engine: Engine, losses: Sequence[Loss]) -> dict[Loss, str]:
    """Return the losses that are seen, in words: of lamps, and of diffuse light in the last."""
    seen = {each: _change(each) for each in losses if each.lamp > MAX_LAMP}
    if squares := _squares(engine, losses, MAX_DIFFUSE):
        seen[losses[-1]] = squares
    return seen


def _squares(engine: Engine, losses: Sequence[Loss], most: float) -> str | None:
    """Tell of squares on diffuse surfaces, where these take a last level that lost more than so."""
    if not (engine.is_last_diffuse and losses and losses[-1].p95 > most):
        return None
    return f"{_change(losses[-1])}: diffuse surfaces, which take it, may show squares of a hue"


def _pack(engine: Engine, light: Light, texels: TexelFormat) -> Package:
    """Return the files of an engine, for some texels; what fails in a foreign one is one line."""
    try:
        made: object = engine.pack(light, texels)
    except Exception as error:
        if isinstance(error, ShrmError) or engine.name in ENGINES:
            raise
        raise PluginError(f"the engine {engine.name!r} failed: {explained(error)}") from error
    if not isinstance(made, Package):
        raise PluginError(f"the engine {engine.name!r} failed: pack() returns {made!r:.40}")
    return made


def _candidates(engine: Engine, name: str | None) -> list[str]:
    """Return the texels that are tried, in turn."""
    if name == "auto":
        return [each for each in engine.auto if each in engine.formats]
    if name is not None:
        return [name]
    first = (engine.formats or ("rgba16f",))[0]
    return [first] if engine.spare is None else [first, engine.spare]


def _change(lost: Loss) -> str:
    return (
        f"changes {lost.what} by {lost.rms:.2%} RMS, {lost.p95:.2%} (95th percentile), "
        f"its lamps by {lost.lamp:.2%}"
    )


_CHUNK = 4096
"""Blocks of a job."""


def _ours(name: str, title: str, coder: ModuleType, dimmest: float) -> TexelFormat:
    """Return a format of blocks of 4 x 4 texels by encoders of blocks of shape (3, 16, n)."""

    def pack(images: Array) -> Words:
        height, width = images.shape[0] * images.shape[1], images.shape[2]
        blocks = images.reshape(height // 4, 4, width // 4, 4, 3)
        blocks = blocks.transpose(4, 1, 3, 0, 2).reshape(3, 16, -1)
        prices = coder.prices_of(blocks)
        jobs = list(slices(blocks.shape[-1], _CHUNK))
        found = in_order(lambda some: coder.encoded(blocks[..., some], prices[some]), jobs)
        parts = [one.arrays for one in found]
        whole = Found(*(np.concatenate(each) for each in zip(*parts, strict=True)))
        return with_lamps(blocks, whole, coder.searched).ravel()

    return TexelFormat(name, title, (coder.LARGEST,) * 3, 16, pack, 4, dimmest)


def _astc(edge: int) -> TexelFormat:
    def pack(images: Array) -> Words:
        data = b"".join(astc.encode(image, edge) for image in images)
        return np.frombuffer(data, dtype=np.uint8)

    return TexelFormat(
        f"astc{edge}x{edge}", f"ASTC {edge}x{edge}", (bc6h.LARGEST,) * 3, 16, pack, edge
    )


BLOCKS = {
    each.name: each
    for each in (
        _ours("bc6h", "BC6H", bc6h, FORMATS["rgba16f"].dimmest),
        _ours("uastc", "UASTC HDR 4x4", uastc, uastc.DIMMEST),
        _astc(4),
        _astc(6),
    )
}
"""The formats by name. They pack stacks of images of shape (n, M, N, 3)."""
ALL = {**FORMATS, **BLOCKS, **PICTURES}
"""All formats of texels by name, those of `shrm_cli.export.pixels` too."""


def refuse_missing(name: str | None) -> None:
    """Refuse a format whose encoder is not installed, before work begins."""
    if name is not None and name.startswith("astc"):
        astc.library()
