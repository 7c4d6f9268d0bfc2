"""Maps on other cubes: as if they had been built there."""

from dataclasses import replace

import numpy as np
import pytest

from research import bilinear
from shrm_cli.errors import ArgumentError
from shrm_cli.maps.explicit.views import Cabral, KautzMcCool, LightField
from shrm_cli.maps.shrm.shrm import CompressedShrm
from shrm_cli.maps.shrm.summed import SummedShrm
from shrm_cli.vocabulary import MAX_CUBE_SIZE
from tests.brute_force import unit
from tests.maps.scenes import make_shrm, normals_of, relative_rms, rms, uniform_points
from tests.maps.shader.cases import irradiance

MAKERS = {
    "shrm": lambda shrm: shrm,
    "compressed": lambda shrm: CompressedShrm.from_shrm(shrm, 4),
    "cabral": Cabral.from_shrm,
    "kautz-mccool": lambda shrm: KautzMcCool.from_shrm(shrm, 4),
    "lightfield": lambda shrm: LightField.from_shrm(shrm, 3),
}


def values_of(made):
    return made.coefficients if hasattr(made, "coefficients") else made.images


@pytest.mark.parametrize("name", MAKERS)
def test_the_same_cube_is_the_same_map(name):
    made = MAKERS[name](make_shrm(size=4))
    assert made.resampled(None, None) is made
    assert made.resampled(4, None) is made
    assert made.resampled(None, "center") is made
    assert made.resampled(4, "center") is made


@pytest.mark.parametrize(
    ("sampling", "size", "to"),
    [("center", 16, "center"), ("center", 64, "center"), ("center", 32, "border"),
     ("border", 32, "center"), ("border", 17, "border"), ("border", 64, "border")],
)  # fmt: skip
@pytest.mark.parametrize(
    ("name", "frame"),
    [("shrm", "global"), ("shrm", "local"), ("cabral", "global"), ("kautz-mccool", "global"),
     ("lightfield", "global")],
)  # fmt: skip
def test_as_if_built_there(name, frame, sampling, size, to):
    """Degree F + P = 5 at 32 texels a face: the cubic filter's error."""
    source = MAKERS[name](make_shrm(order_f=3, size=32, sampling=sampling, frame=frame))
    truth = MAKERS[name](make_shrm(order_f=3, size=size, sampling=to, frame=frame))
    found = source.resampled(size, to)
    assert type(found) is type(source)
    assert (found.size, found.sampling, found.frame) == (size, to, truth.frame)
    assert replace(found.info, added_error=0.0) == replace(source.info, added_error=0.0)
    error = relative_rms(values_of(found), values_of(truth))
    print(f"{name} {frame} {sampling} 32 -> {to} {size}: {error:.2e}")
    assert error < 2e-4
    worst = np.abs(values_of(found) - values_of(truth)).max() / rms(values_of(truth))
    assert worst < 3e-3


def test_errors_fall_with_the_third_power_of_the_size():
    errors = [
        relative_rms(
            make_shrm(order_f=3, size=size).resampled(24, "center").coefficients,
            make_shrm(order_f=3, size=24).coefficients,
        )
        for size in (10, 20, 40)
    ]
    assert errors[1] < errors[0] / 6
    assert errors[2] < errors[1] / 6


@pytest.mark.parametrize("frame", ["global", "local"])
@pytest.mark.parametrize("count", [2, 9])
def test_compressed_maps_keep_their_components(count, frame):
    shrm = make_shrm(order_f=3, size=32, frame=frame)
    made = CompressedShrm.from_shrm(shrm, count)
    found = made.resampled(20, "border")
    assert isinstance(found, CompressedShrm)
    assert (found.cube_count, found.size, found.sampling, found.frame) == (
        count,
        20,
        "border",
        frame,
    )
    assert replace(found.info, added_error=0.0) == replace(made.info, added_error=0.0)
    centers, views = unit(np.random.default_rng(51), 500), unit(np.random.default_rng(52), 500)
    if frame == "local" and count < 9:
        # Without some of its components a local map is not smooth where its frames turn, at +-Z.
        centers = centers[np.abs(centers[:, 2]) < 0.95]
        views = views[: len(centers)]
    points = normals_of(centers, views), views
    assert relative_rms(found.radiance(*points), made.radiance(*points)) < 1e-3


@pytest.mark.parametrize("name", MAKERS)
@pytest.mark.parametrize("size", [1, 2, 3])
def test_tiny_maps(name, size):
    found = MAKERS[name](make_shrm(order_f=1, order_p=1, size=4)).resampled(size, "border")
    assert (found.size, found.sampling) == (size, "border")
    assert np.isfinite(found.radiance(*uniform_points(20))).all()


@pytest.mark.parametrize("name", MAKERS)
def test_size_is_bounded_before_anything_is_allocated(name):
    made = MAKERS[name](make_shrm(size=2))
    with pytest.raises(ArgumentError, match=r"1 \.\. 4096"):
        made.resampled(3_000_000, None)


@pytest.mark.parametrize("name", MAKERS)
def test_precision_is_kept(name):
    for dtype in (np.float32, np.float64):
        made = MAKERS[name](make_shrm(size=4, dtype=dtype)).resampled(6, None)
        if isinstance(made, CompressedShrm):
            assert made.components.dtype == dtype
        else:
            assert values_of(made).dtype == dtype


@pytest.mark.parametrize("kind", ["shrm", "local", "compressed", "sum", "cabral"])
@pytest.mark.parametrize(("size", "sampling"), [(12, "center"), (40, "center"), (17, "border")])
def test_the_error_of_look_ups_is_that_of_the_new_size(rng, kind, size, sampling):
    """Four texels weighted by hand, against the same light on a cube four times as fine."""
    options = {"order_f": 8, "size": 24}
    source = make_shrm(frame="local" if kind == "local" else "global", **options)
    source = replace(source, info=replace(source.info, filter_error=0.9))
    if kind == "sum":
        source = SummedShrm((source, make_shrm(seed=1, **options)), source.info)
    elif kind in MAKERS:
        source = MAKERS[kind](source)
    found = source.resampled(size, sampling)
    # The harmonics of the view are orthonormal, and those of two maps that add up are the same.
    seeds = [0, 1] if kind == "sum" else [0]
    fine = sum(make_shrm(order_f=8, size=160, seed=seed).planes()[0] for seed in seeds)
    cubes = [make_shrm(order_f=8, size=size, sampling=sampling, seed=seed) for seed in seeds]
    coarse = sum(each.planes()[0] for each in cubes)
    places = unit(rng, 4000)
    truth = bilinear.look_up(fine, places)
    seen = bilinear.look_up(coarse, places, sampling)
    measured = rms(seen - truth) / rms(truth)
    print(f"{kind} {size} {sampling}: {found.info.filter_error:.5f}, measured {measured:.5f}")
    assert found.info.filter_error == pytest.approx(measured, rel=0.15)


def test_errors_that_nobody_stated_are_not_made_up():
    assert make_shrm(size=12).resampled(8).info.filter_error == 0


@pytest.mark.parametrize("name", [*MAKERS, "irradiance"])
@pytest.mark.parametrize("size", [0, -4, 3.5, "8", True, MAX_CUBE_SIZE + 1])
def test_sizes_that_cubes_cannot_have_are_refused(name, size):
    made = irradiance(2) if name == "irradiance" else MAKERS[name](make_shrm(size=4))
    with pytest.raises(ArgumentError, match=r"^`size` .* is not a whole number of 1 .. 4096$"):
        made.resampled(size)


@pytest.mark.parametrize("name", [*MAKERS, "irradiance"])
def test_samplings_that_nobody_knows_are_refused(name):
    made = irradiance(2) if name == "irradiance" else MAKERS[name](make_shrm(size=4))
    with pytest.raises(ArgumentError, match="`sampling` 'corner' is not one of center, border"):
        made.resampled(8, "corner")


@pytest.mark.parametrize("name", MAKERS)
@pytest.mark.parametrize("order", [-1, 1.5, "1"])
def test_orders_that_no_map_has_are_refused(name, order):
    made = MAKERS[name](make_shrm(size=4))
    with pytest.raises(ArgumentError, match=r"^`order_p` .* is not a whole number of 0 .. 32$"):
        made.to_shrm(order)


@pytest.mark.parametrize(
    ("to", "options"),
    [
        ("lightfield", {"views": -1}),
        ("lightfield", {"views": "2"}),
        ("kautz-mccool", {"slices": 0}),
        ("shrm", {"compress": 0}),
        ("shrm", {"frame": "world"}),
        ("shrm", {"max_size": "much"}),
    ],
)
def test_options_of_conversions_are_checked(to, options):
    (name,) = options
    with pytest.raises(ArgumentError, match=f"^`{name}` .* is not "):
        make_shrm(size=4).converted(to, **options)


def test_forms_of_irradiance_are_checked():
    """It was taken, and its file was none that anybody reads."""
    with pytest.raises(ArgumentError, match="`form` 'zh4' is not one of sh, zh3"):
        irradiance(2).converted("irradiance", form="zh4")


def test_numbers_of_numpy_are_numbers():
    made = make_shrm(size=4)
    assert made.resampled(np.int64(8)).size == 8
    assert made.converted("shrm", compress=np.int64(2)).cube_count == 2
