"""Files of split sums: what is written is read back, and what does not fit is refused."""

import numpy as np
import OpenEXR
import pytest

from shrm_cli.errors import MapError
from shrm_cli.files.parts import open_file, write_parts
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.splitsum.file import decode, encode, level_names
from shrm_cli.maps.splitsum.split_sum import SplitSum

SIZES = 16, 8, 8


def info(order_f, domain="frequency"):
    brdf = {"name": "ggx-lobe", "parameters": {}}
    return MapInfo(order_f, 0, 0.001, 0.75, 0.125, brdf, "a.exr", "0", domain=domain)


def made_up(rng, roughness=(0.0, 1 / 7, 1.0), mapping="filament", domain="frequency"):
    levels = tuple(
        rng.uniform(0, 2, (6 * n, n, 3)).astype(np.float16).astype(np.float32)
        for n in SIZES[: len(roughness)]
    )
    infos = (info(6, "angular"), info(40, domain), info(9))[: len(roughness)]
    return SplitSum(levels, roughness, mapping, infos[-1], "center", infos)


def written(path, parts, precision="auto"):
    write_parts(path, parts, precision)
    return open_file(path)


def changed(split_sum, part=1, channels=None, **header):
    """Its parts, with attributes of one of them replaced, or left out where None."""
    parts = encode(split_sum)
    old = parts[part]
    new = {**old.header, **{name.replace("__", ":"): value for name, value in header.items()}}
    new = {name: value for name, value in new.items() if value is not None}
    parts[part] = type(old)(channels or old.channels, new)
    return parts


@pytest.mark.parametrize("precision", ["half", "float"])
@pytest.mark.parametrize("mapping", ["linear", "filament"])
def test_what_is_written_is_read_back(tmp_path, rng, precision, mapping):
    split_sum = made_up(rng, mapping=mapping)
    found = decode(written(tmp_path / "a.exr", encode(split_sum), precision))
    assert len(found.levels) == 3
    for one, other in zip(found.levels, split_sum.levels, strict=True):
        assert np.array_equal(one, other)
    assert found.roughness == pytest.approx(split_sum.roughness, rel=1e-7)
    assert (found.mapping, found.sampling) == (mapping, "center")
    assert found.level_info == split_sum.level_info
    assert (found.info.order_f, found.info.domain) == (40, "frequency")
    assert found.info.brdf["parameters"]["roughness"] == list(found.roughness)


def test_a_level_that_was_integrated_is_said_to_be(tmp_path, rng):
    split_sum = made_up(rng, domain="angular")
    found = decode(written(tmp_path / "a.exr", encode(split_sum)))
    assert found.info.domain == "angular"
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        assert file.parts[1].header["shrm:domain"] == "angular"
        assert "shrm:domain" not in file.parts[2].header


def test_one_level_is_a_split_sum_too(tmp_path, rng):
    split_sum = made_up(rng, roughness=(0.3,), mapping="unreal")
    found = decode(written(tmp_path / "a.exr", encode(split_sum)))
    assert np.array_equal(found.levels[0], split_sum.levels[0])
    assert found.roughness == (0.3,)


def test_border_sampling_is_kept(tmp_path, rng):
    parts = [
        type(part)(part.channels, {**part.header, "envmap": "openexr"})
        for part in encode(made_up(rng))
    ]
    assert decode(written(tmp_path / "a.exr", parts)).sampling == "border"


def test_the_file_is_as_documented(tmp_path, rng):
    written(tmp_path / "a.exr", encode(made_up(rng)))
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        names = [part.name() for part in file.parts]
        headers = [dict(part.header) for part in file.parts]
        sizes = [part.channels["R"].pixels.shape for part in file.parts]
    assert names == ["roughness0.00", "roughness0.14", "roughness1.00"]
    assert sizes == [(96, 16), (48, 8), (48, 8)]
    for header, roughness in zip(headers, (0, 1 / 7, 1), strict=True):
        assert header["shrm:representation"] == "splitsum"
        assert header["shrm:version"] == 3
        assert header["shrm:mapping"] == "filament"
        assert header["shrm:roughness"] == pytest.approx(roughness, rel=1e-7)
        assert header["shrm:center"] == "reflection"
        assert [list(corner) for corner in header["displayWindow"]] == [[0, 0], [15, 95]]


def test_names_are_those_of_the_roughnesses_that_are_stored(tmp_path, rng):
    """Single precision may round to the other side of half a hundredth."""
    split_sum = made_up(rng, roughness=(0.28500000001, 0.9))
    found = decode(written(tmp_path / "a.exr", encode(split_sum)))
    assert found.roughness == (0.285, 0.9)


def test_names_have_as_many_decimals_as_they_need():
    assert level_names([0.0, 0.14]) == ["roughness0.00", "roughness0.14"]
    assert level_names([0.501, 0.5034]) == ["roughness0.501", "roughness0.503"]
    assert level_names([0.5, 0.50001])[1] == "roughness0.50001"


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ({"name": "roughness0.15"}, "not the levels"),
        ({"shrm__roughness": 0.3}, "not the levels"),
        ({"shrm__roughness": 0.0}, "not the levels"),
        ({"shrm__roughness": None}, "shrm:roughness"),
        ({"shrm__roughness": 2.0}, "shrm:roughness"),
        ({"shrm__roughness": float("nan")}, "shrm:roughness"),
        ({"shrm__roughness": "0.14"}, "shrm:roughness"),
        ({"shrm__mapping": "linear"}, "shrm:mapping"),
        ({"shrm__mapping": None}, "shrm:mapping"),
        ({"shrm__mapping": 3}, "shrm:mapping"),
        ({"shrm__center": "normal"}, "not the levels"),
        ({"shrm__frame": "local"}, "global axes"),
        ({"shrm__layout": "strip"}, "OpenEXR's cube"),
        ({"shrm__F": None}, "shrm:F"),
        ({"shrm__representation": "shrm"}, "not the levels"),
        ({"envmap": "openexr"}, "sampled differently"),
    ],
)
def test_attributes_are_not_believed(tmp_path, rng, change, part):
    with pytest.raises(MapError, match=part) as error:
        decode(written(tmp_path / "a.exr", changed(made_up(rng), **change)))
    assert "a.exr" in str(error.value)
    assert "\n" not in str(error.value)


def test_a_mapping_that_no_reader_knows(tmp_path, rng):
    parts = encode(made_up(rng))
    parts = [type(p)(p.channels, {**p.header, "shrm:mapping": "other"}) for p in parts]
    with pytest.raises(MapError, match="shrm:mapping"):
        decode(written(tmp_path / "a.exr", parts))


def test_a_logarithmic_mapping_has_no_level_of_roughness_0(tmp_path, rng):
    with pytest.raises(MapError, match="shrm:mapping"):
        decode(written(tmp_path / "a.exr", encode(made_up(rng, mapping="unreal"))))


@pytest.mark.parametrize("shape", [(48, 9), (47, 8), (102, 17)])
def test_sizes_are_checked(tmp_path, rng, shape):
    planes = {c: np.ones(shape, np.float32) for c in "RGB"}
    with pytest.raises(MapError, match=f"a level of {shape[1]} x {shape[0]} is not a cube, or"):
        decode(written(tmp_path / "a.exr", changed(made_up(rng), channels=planes)))


@pytest.mark.parametrize("names", ["RG", "RGBA", "XYZ"])
def test_channels_are_checked(tmp_path, rng, names):
    planes = {c: np.ones((48, 8), np.float32) for c in names}
    with pytest.raises(MapError, match="channels of a level"):
        decode(written(tmp_path / "a.exr", changed(made_up(rng), channels=planes)))


def test_a_value_that_is_not_finite_is_refused(tmp_path, rng):
    sound, path = tmp_path / "sound.exr", tmp_path / "a.exr"
    written(sound, encode(made_up(rng)), "float")
    with OpenEXR.File(str(sound), separate_channels=True) as file:
        parts = []
        for part in file.parts:
            planes = {name: channel.pixels.copy() for name, channel in part.channels.items()}
            planes["G"][3, 4] = np.nan if part.header["shrm:roughness"] == 1 else 1.0
            header = {name: value for name, value in part.header.items() if name != "channels"}
            parts.append(OpenEXR.Part(header, planes))
        OpenEXR.File(parts).write(str(path))
    with pytest.raises(MapError, match="NaN"):
        decode(open_file(path))
