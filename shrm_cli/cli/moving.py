"""Options about frames, moving pictures and light that moves, and what they mean together."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import click

import shrm_cli as shrm
from shrm_cli.cli import options, usage
from shrm_cli.cli.types import BYTES, FILE, PATH, TURN, option, way, whole, within
from shrm_cli.vocabulary import DEFAULT_FPS, DEFAULT_FRAMES

if TYPE_CHECKING:
    from shrm_cli.render.moving import Key, Moment
    from shrm_cli.render.stage import Stage

fps_option = option(
    "--fps X", within(0.1, 120), f"Frames a second of a moving picture.  [default: {DEFAULT_FPS:g}]"
)
max_memory_option = option(
    "--max-memory BYTES", BYTES,
    help="The most memory that pictures may take, such as 2GB: GIF and APNG hold all frames.  "
    "[default: half of the machine's]",
)  # fmt: skip
frames_option = option(
    "--frames N", whole(1, 9999),
    help="Walk around it in N steps, or let its light or what varies move in as many: a file for "
    "each, whose name holds %04d, or one moving picture.  "
    f"[default of .apng, .gif, .mp4: {DEFAULT_FRAMES}]",
)  # fmt: skip
light_options = options.several(
    option(
        "--turn-light", TURN,
        help="Turn the light about x, y, z or an axis X/Y/Z by so many degrees, or by equal steps "
        "of them with --frames.",
    ),
    option(
        "--blend-to MAP", FILE, multiple=True,
        help="The map of the same BRDF whose light that of MAP becomes, over the frames; one for "
        "each MAP.",
    ),
    option(
        "--blend X", within(0, 1),
        help="How much of the light is that of --blend-to, in the last frame.  [default: 1]",
    ),
    option(
        "--irradiance-to MAP", FILE,
        help="Irradiance map that --irradiance becomes with --blend-to.",
    ),
    option("--background-to PROBE", PATH, "Light probe that --background becomes with --blend-to."),
)  # fmt: skip
"""The options of light that moves."""
LIGHT_MOVES = ("turn_light", "blend_to", "blend", "irradiance_to", "background_to")
"""The names of the options that move the light."""


def split_vary(texts: Sequence[str]) -> tuple[str | None, dict[str, tuple[float, float]]]:
    """Return what parameters follow, ``vertex`` or an image, or the ways of their values."""
    known = {text: way(text) for text in texts}
    follows = [text for text, found in known.items() if found is None]
    ways = {found[0]: found[1:] for found in known.values() if found is not None}
    if len(texts) > max(1, len(ways)) or (follows and ways):
        raise usage.wrong_usage(
            "--vary takes vertex, an image, or a value of each parameter; give one"
        )
    for text in follows:
        if _is_number(text) and not os.path.exists(text):
            raise usage.wrong_usage(f"--vary {text} names no parameter; give NAME={text}")
    return next(iter(follows), None), ways


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def frame_targets(
    output: str, frames: int | None, pictures: Sequence[str] = (".png", ".exr")
) -> tuple[int | None, list[str]]:
    """Return how many frames there are, None for a picture, and the files that they make.

    `pictures` are the suffixes of what does not move.
    """
    from shrm_cli.errors import OutputError
    from shrm_cli.files.animation import ANIMATED, check_animation, is_animated
    from shrm_cli.render.moving import check_one_file, frame_paths

    moving = is_animated(output)
    usage.refuse_inapplicable({"fps": (moving, "to moving pictures, .apng, .gif and .mp4")})
    if moving:
        check_one_file(output, "a moving picture")
        check_animation(output)
        return frames or DEFAULT_FRAMES, [output]
    if os.path.splitext(output)[1].lower() not in pictures:
        kinds = ", ".join((*pictures, *ANIMATED))
        raise OutputError(f"{output}: what is written is {kinds}; name it so")
    if frames is None:
        check_one_file(output, "what is made without `frames`")
        return None, [output]
    return frames, frame_paths(output, frames)


def scene_keys(mesh: str | None) -> list[Key]:
    """Return the keyframes of a scene, which say how many frames there are."""
    from shrm_cli.render.moving import read_keys
    from shrm_cli.render.scene_file import is_scene_name

    keys = read_keys(mesh) if mesh is not None and is_scene_name(mesh) else []
    said = (not keys, "without [[key]] in the scene, which says it")
    usage.refuse_inapplicable({"frames": said, "turn_light": said, "blend": said, "vary": said})
    return keys


def shown_ways(
    mesh: str | None, follows: str | None, ways: dict[str, tuple[float, float]]
) -> dict[str, tuple[float, float]] | None:
    """Return the ways of the values that are shown; None where any value may be.

    That is where parameters follow an image or the vertices, and in scenes, which say it of each
    object and each key.
    """
    from shrm_cli.render.scene_file import is_scene_name

    is_scene = mesh is not None and is_scene_name(mesh)
    return None if follows is not None or is_scene else ways


def moments(
    view: tuple[float, float],
    frames: int | None,
    values: dict[str, Any],
    keys: Sequence[Key],
    ways: Mapping[str, tuple[float, float]],
) -> list[Moment]:
    """Return the frames that are drawn, or the one picture; parameters go the ways over them."""
    from shrm_cli.render.moving import Moment, moving_light, turntable, with_ways

    blends = (bool(values["blend_to"]), "with --blend-to")
    usage.refuse_inapplicable({"blend": blends, "background_to": blends})
    shown = ("background" in usage.given_options(), "with --background")
    usage.refuse_inapplicable({"background_to": shown})
    if keys:
        from shrm_cli.render.moving import moments_between

        if blends[0] != any(each.blend is not None for each in keys):
            raise click.UsageError("--blend-to and a blend in [[key]] of the scene need each other")
        return moments_between(keys, shrm.Viewer(*view))
    turn, share = values["turn_light"], None
    if values["blend_to"]:
        share = 1.0 if values["blend"] is None else values["blend"]
    vary = any(low != high for low, high in ways.values())
    if vary and frames is None:
        raise usage.wrong_usage("--vary NAME=LOW..HIGH goes with --frames; give a single value")
    if vary or turn is not None or share is not None:
        found = moving_light(shrm.Viewer(*view), frames, turn, share)
    else:
        found = [Moment(each) for each in turntable(shrm.Viewer(*view), frames or 1)]
    return with_ways(found, ways)


def open_others(paths: Sequence[str], maps: Sequence[shrm.Map]) -> list[shrm.Map]:
    """Read the maps that others become, and check that they can."""
    from shrm_cli.render.moving import check_blend

    if paths and len(paths) != len(maps):
        raise click.UsageError(f"{len(paths)} --blend-to of {len(maps)} MAP; give one for each")
    others = [shrm.open_map(path) for path in paths]
    for first, second, path in zip(maps, others, paths, strict=False):
        check_blend(first, second, path)
    return others


def open_other_light(stage: Stage, values: dict[str, Any]) -> Stage:
    """Return the stage under the irradiance that its own becomes, itself where it has none."""
    from shrm_cli.render.moving import check_blend
    from shrm_cli.render.scene_file import as_irradiance

    blends, first, second = (values[k] for k in ("blend_to", "irradiance", "irradiance_to"))
    with_both = (bool(blends and first), "with --blend-to and --irradiance")
    usage.refuse_inapplicable({"irradiance_to": with_both})
    # Only the light of --irradiance itself can become another one, that of --irradiance-to.
    lights, blended = {id(each) for each in stage.irradiances()}, 0 if second is None else 1
    if blends and (stage.maps() or len(lights) > blended):
        raise click.UsageError(
            "--blend-to applies to meshes of which all light is that of MAP; leave the maps and "
            "the light of objects out, and give --irradiance-to beside --irradiance"
        )
    if second is not None:
        other = as_irradiance(second)
        check_blend(as_irradiance(first), other, second)
        return stage.under_irradiance(other)
    return stage
