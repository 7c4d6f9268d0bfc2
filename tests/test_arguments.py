"""What the library refuses: arguments of a wrong kind or size, before anything is read or made."""

import inspect
import pickle  # noqa: TID251
from pathlib import Path

import numpy as np
import pytest

import shrm_cli as shrm
from shrm_cli.errors import ShrmError

FUNCTIONS = {
    name: value
    for name in shrm.__all__
    if inspect.isfunction(value := getattr(shrm, name)) and inspect.signature(value).parameters
}
ONES = np.ones((4, 8, 3), np.float32)
GOOD = {
    "at": (0, 0, 0),
    "direction": [0, 0, 1],
    "edit": shrm.Edit([], np.ones(3), [], np.eye(3)),
    "entries": shrm.Entry("none.exr"),
    "order": 2,
    "paths": ["none.jpg"],
    "probe": shrm.Probe.from_array(ONES),
    "size": 8,
    "sun_azimuth": 0,
    "sun_elevation": 30,
    **dict.fromkeys(("normals", "picture", "truth", "views"), (0.0, 0.0, 1.0)),
}
"""What arguments without a default may be; all others may be the name of a file that is not."""


CASES = [
    (name, each.name)
    for name, function in FUNCTIONS.items()
    for each in inspect.signature(function).parameters.values()
    if each.kind is not each.VAR_KEYWORD
]


@pytest.mark.parametrize(("name", "argument"), CASES)
def test_arguments_of_a_wrong_kind_are_refused_at_once(name, argument):
    parameters = inspect.signature(FUNCTIONS[name]).parameters.values()
    given = {
        each.name: GOOD.get(each.name, "none.exr")
        for each in parameters
        if each.default is each.empty and each.kind is not each.VAR_KEYWORD
    }
    if "contacts" in given:
        given["contacts"] = shrm.draw_contacts("none.exr")
    with pytest.raises(shrm.ArgumentError, match=rf"^`{argument}` <object object .*> is not \w"):
        FUNCTIONS[name](**{**given, argument: object()})


MAP, OFFERS = shrm.prefilter(ONES, to="irradiance"), shrm.prefilter(ONES, to="splitsum", size=8)
WRONG = {
    "unknown": (lambda: shrm.furnace(8, foo=1), "`foo` is no argument of furnace, which takes `s"),
    "missing": (lambda: shrm.furnace(), "`furnace` takes `size`, `radiance`: missing a required"),
    "too many": (lambda: shrm.furnace(1, 2, 3), "too many positional arguments$"),
    "text": (lambda: shrm.furnace(8, "x"), "^`radiance` 'x' is not numbers$"),
    "ragged": (lambda: shrm.furnace(8, [1, [2]]), r"^`radiance` \[1, \[2\]\] is not numbers$"),
    "fraction": (lambda: shrm.studio(2.5), r"^`size` 2.5 is not a whole number$"),
    "flag": (lambda: shrm.studio(True), r"^`size` True is not a whole number$"),
    "NaN": (lambda: shrm.studio(8, float("nan")), "^`key` nan is not a number$"),
    "name": (
        lambda: shrm.to_layout(GOOD["probe"], "hcross", "x"),
        "^`orientation` 'x' is not one of openexr, gl$",
    ),
    "alternatives": (
        lambda: shrm.prefilter(ONES, 3),
        "^`brdf` 3 is not a Brdf or text or a path$",
    ),
    "lines": (lambda: shrm.prefilter(ONES, to="she", law=np.eye(2)), "^`law` array.* is not one"),
    "length": (lambda: shrm.render(MAP, (1, 2, 3)), r"^`view` \(1, 2, 3\) is not 2 numbers$"),
    "of a list": (lambda: shrm.choose(ONES, ["x", 1]), r"^`brdfs` \['x', 1\] is not a list or"),
    "pixels": (lambda: shrm.open_map(ONES), "is not text or a path; give pixels to Probe.from"),
    "form": (lambda: shrm.prefilter(ONES, to="zz"), "^`to` 'zz' is none of auto, shrm, cabral"),
    "other form": (
        lambda: shrm.convert(MAP, "auto"),
        "^`to` 'auto' is none of shrm, .* layers, lat",
    ),
    "transfer": (lambda: shrm.transfer("none.obj", foo=1), "^`foo` is no argument of transfer_"),
    "albedo": (lambda: shrm.transfer("none.obj", samples="x"), "^`samples` 'x' is not a whole"),
    "layers": (lambda: shrm.convert(OFFERS, "layers", foo=1), "^`foo` does not apply to `to` lay"),
    "no tolerance": (lambda: shrm.analyze("lambertian", tolerances=[]), "`tolerances` .* within"),
    "0 tolerance": (lambda: shrm.analyze("lambertian", tolerances=[0]), "`tolerances` .* within"),
    "order": (lambda: shrm.analyze("lambertian", order_f=-1), "`order_f` is -1; give a whole"),
    "one brdf": (lambda: shrm.choose(ONES, []), "^`brdfs` are none"),
    "names": (lambda: shrm.compare([MAP], ONES, names=[]), "^`names` are 0 of 1 maps; give one"),
    "views": (lambda: shrm.compare([MAP], ONES, views=[]), "^`views` are none; give one"),
    "no picture": (lambda: shrm.compare([MAP], ONES, size=0), "^`size` is 0; give a whole number"),
    "rows": (lambda: shrm.compare([MAP], ONES, "lambertian", source_height=0), "`source_height` i"),
    "sources": (lambda: shrm.export([], "three"), "^`sources` are none"),
    "forms": (lambda: shrm.report(ONES, "lambertian", []), "^`to` are none"),
    "angles": (lambda: shrm.report(ONES, "lambertian", angles=[]), "^`angles` are none"),
    "sphere": (lambda: shrm.report(ONES, "lambertian", picture_size=0), "^`picture_size` is 0"),
    "truth": (lambda: shrm.report(ONES, "lambertian", truth_height=0), "^`truth_height` is 0"),
    "cells": (lambda: shrm.lookdev("none.exr", "lambertian", size=-1), "^`size` is -1"),
    "brushed": (lambda: shrm.view(OFFERS, anisotropy=-1), "^`anisotropy` is -1; give 0 to 1"),
    "radius": (lambda: shrm.render(MAP, radius=1), "^`radius` does not apply to a sphere that is"),
    "box": (lambda: shrm.grid("none.obj", box=[0, 1]), "^`box` must be 6 numbers"),
    "grid": (lambda: shrm.grid("none.obj", order=-1), "^`order` is -1"),
    "rays": (lambda: shrm.grid("none.obj", samples=0), "^`samples` is 0"),
    "place": (lambda: shrm.capture("none.obj", []), r"^`at` must be 3 numbers, not \[\]"),
    "height": (lambda: shrm.capture("none.obj", (0, 0, 0), size=0), "^`size` is 0"),
    "jobs": (lambda: shrm.batch([], jobs=-1), "^`jobs` is -1"),
    "seed": (lambda: shrm.examine("lambertian", seed=-1), "^`seed` is -1"),
    "infinite": (lambda: shrm.split_lamps(ONES, error=np.inf), "^`error` is inf"),
    "threads": (lambda: shrm.using(threads="x"), "^`threads` is 'x'; give a number"),
    "cache": (lambda: shrm.using(cache="x"), "^`cache` is 'x'; give True, False or a Path"),
    "viewer": (lambda: shrm.Viewer("x"), "^`azimuth` 'x' is not a number$"),
    "field": (lambda: shrm.Viewer(foo=1), "^`foo` is no field of Viewer: azimuth, elevation$"),
    "long": (lambda: shrm.sky(8, 0, 30, 10**400), "^`turbidity` 1000*.* is not a number$"),
    "normal": (
        lambda: shrm.reference(np.ones((4, 8, 3)), "phong", np.zeros(3), [0, 0, 1]),
        "^`normals` hold .0.0, 0.0, 0.0., whose length is 0 or not finite$",
    ),
    "asked": (lambda: shrm.Asked(size="x"), "^`size` 'x' is not a whole number$"),
    "terms": (lambda: shrm.Terms(force="x"), "^`force` 'x' is not True or False$"),
    "look": (lambda: shrm.Look(views=3), "^`views` 3 is not True or False$"),
    "dimming": (lambda: shrm.Dimming([0, 1, 0], 1, 30), r"^`direction` .* is not a ndarray$"),
    "edit": (lambda: shrm.Edit(3, *[np.ones(3)] * 3), "^`numbers` 3 is not a list$"),
    "entry": (lambda: shrm.Entry(3), "^`probes` 3 is not a list or text or a path$"),
    "mapping": (lambda: shrm.Entry("p.exr", arguments=3), "^`arguments` 3 is not a mapping$"),
}


@pytest.mark.parametrize("what", WRONG)
def test_each_is_refused_in_one_line(what):
    call, words = WRONG[what]
    with pytest.raises(ShrmError, match=words) as refused:
        call()
    assert "\n" not in str(refused.value)


def test_numbers_of_numpy_and_iterators_are_taken():
    assert shrm.studio(np.int64(4), np.float32(2)).shape == (4, 8, 3)
    assert shrm.furnace(2, np.array([0.5, 1, 2])).shape == (2, 4, 3)
    assert len(shrm.choose(ONES, (each for each in [Path("none"), "lambertian"][1:]))) == 1
    assert shrm.render(MAP, np.zeros(2), 16).shape == (16, 16, 3)


def test_functions_are_themselves_when_they_are_pickled():
    for name, function in FUNCTIONS.items():
        assert pickle.loads(pickle.dumps(function)) is function is getattr(shrm, name)
