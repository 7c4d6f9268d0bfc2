"""SH exponential <-> file: one row of coefficients, and nothing believed that is not so."""

import os
from dataclasses import replace

import numpy as np
import OpenEXR
import pytest

from shrm_cli.errors import MapError, OutputError
from shrm_cli.maps.file import is_map, open_map
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.she.exponential import SphericalHarmonicExponential
from tests.maps.damage import parts, refused, survives_flipped_bits, writer_of_damage

INFO = MapInfo(
    64, 0, 0.03, 1.0, 0.0, {"name": "ggx", "parameters": {}}, "p.exr", "ab" * 32, fit_residual=0.125
)


def random_map(order_p=4, order_q=2, info=INFO, **changes):
    rng = np.random.default_rng(order_p)
    made = SphericalHarmonicExponential(
        rng.normal(size=((order_p + 1) ** 2, 3)),
        rng.normal(size=((order_q + 1) ** 2 - 1, 3)),
        (0.25, 1.0),
        info,
    )
    return replace(made, **changes)


@pytest.fixture
def damaged(tmp_path):
    """Writes a sound map with its header and channels changed; None removes."""
    random_map().save(tmp_path / "sound.exr")
    return writer_of_damage(tmp_path / "sound.exr")


@pytest.mark.parametrize(("order_p", "order_q"), [(4, 2), (0, 0), (3, 0), (0, 3), (16, 16)])
@pytest.mark.parametrize("law", ["lobe", "paper"])
def test_what_is_read_is_what_was_written(tmp_path, order_p, order_q, law):
    made = random_map(order_p, order_q, law=law)
    assert made.save(tmp_path / "a.exr") == "float"
    back = open_map(tmp_path / "a.exr")
    assert isinstance(back, SphericalHarmonicExponential)
    np.testing.assert_array_equal(back.p_coefficients, made.p_coefficients.astype(np.float32))
    np.testing.assert_array_equal(back.q_coefficients, made.q_coefficients.astype(np.float32))
    assert (back.order_p, back.order_q) == (order_p, order_q)
    assert (back.ggx_alpha, back.law) == ((0.25, 1.0), law)
    assert back.info == made.info
    assert is_map(tmp_path / "a.exr")


def test_the_row_is_p_then_q(tmp_path):
    made = random_map()
    made.save(tmp_path / "a.exr")
    header, channels = parts(tmp_path / "a.exr")
    assert set(channels) == set("RGB")
    for k, c in enumerate("RGB"):
        assert channels[c].shape == (1, 25 + 8)
        assert channels[c].dtype == np.float32
        np.testing.assert_allclose(channels[c][0, :25], made.p_coefficients[:, k], rtol=1e-7)
        np.testing.assert_allclose(channels[c][0, 25:], made.q_coefficients[:, k], rtol=1e-7)
    expected = {
        "shrm:representation": "she",
        "shrm:version": 3,
        "shrm:frame": "global",
        "shrm:center": "reflection",
        "shrm:P": 0,
        "shrm:p_order": 4,
        "shrm:q_order": 2,
        "shrm:law": "lobe",
        "shrm:probe": "p.exr",
    }
    for name, value in expected.items():
        assert header[name] == value
    np.testing.assert_allclose(header["shrm:ggx_alpha"], (0.25, 1.0))
    assert os.path.getsize(tmp_path / "a.exr") < 2500


def test_the_range_is_the_number_that_it_was(tmp_path):
    """0.04 and not 0.0399999991059303, which a 32-bit float would be as a double."""
    random_map(ggx_alpha=(0.04, 0.81)).save(tmp_path / "a.exr")
    assert open_map(tmp_path / "a.exr").ggx_alpha == (0.04, 0.81)


def test_half_where_it_is_asked_for(tmp_path):
    made = random_map()
    assert made.save(tmp_path / "a.exr", "half") == "half"
    np.testing.assert_array_equal(
        open_map(tmp_path / "a.exr").p_coefficients, made.p_coefficients.astype(np.float16)
    )


def test_bytes_are_the_same_each_time(tmp_path):
    for name in "ab":
        random_map().save(tmp_path / f"{name}.exr")
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


def test_other_layouts_and_values_that_cannot_be_held(tmp_path):
    with pytest.raises(MapError, match="OpenEXR's cube only"):
        random_map().save(tmp_path / "a.exr", layout="strip", orientation="gl")
    broken = random_map()
    broken.p_coefficients[3, 1] = np.nan
    with pytest.raises(OutputError, match="not finite"):
        broken.save(tmp_path / "a.exr")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("p_order", None), ("p_order", -1), ("p_order", 17), ("p_order", 2**31 - 1),
        ("p_order", "4"), ("p_order", 4.0),
        ("q_order", None), ("q_order", -1), ("q_order", 17), ("q_order", "2"),
        ("ggx_alpha", None), ("ggx_alpha", 0.5), ("ggx_alpha", (0.0, 1.0)),
        ("ggx_alpha", (0.5, 0.25)), ("ggx_alpha", (0.5, 2.0)),
        ("ggx_alpha", (float("nan"), 1.0)), ("ggx_alpha", (0.1, 0.2, 0.3)),
        ("ggx_alpha", "0.5,1"), ("ggx_alpha", (1, 1)),
        ("law", None), ("law", "square"), ("law", 1), ("law", ""),
    ],
    ids=lambda value: str(value)[:20],
)  # fmt: skip
def test_wrong_attributes(damaged, name, value):
    refused(damaged({f"shrm:{name}": value}), f"shrm:{name} is missing or wrong; make it again")


@pytest.mark.parametrize(
    "changes", [{"shrm:p_order": 3}, {"shrm:p_order": 16, "shrm:q_order": 16}, {"shrm:q_order": 0}]
)
def test_orders_must_be_those_of_the_row(damaged, changes):
    refused(damaged(changes), "33 x 1 pixels are not the ", "coefficients of orders P = ")


def plane(shape=(1, 33), value=0.5, dtype=np.float32):
    return np.full(shape, value, dtype)


@pytest.mark.parametrize(
    ("planes", "words"),
    [
        ({"A": plane()}, "channels"),
        ({"G": None}, "channels"),
        ({"R": None, "G": None, "B": None, "Y": plane()}, "channels"),
        ({c: plane(dtype=np.uint32, value=1) for c in "RGB"}, "channels"),
        ({c: plane((2, 33)) for c in "RGB"}, "33 x 2 pixels are not the 25 + 8 coefficients"),
        ({c: plane((33, 1)) for c in "RGB"}, "1 x 33 pixels are not the 25 + 8 coefficients"),
        ({c: plane((1, 34)) for c in "RGB"}, "34 x 1 pixels are not the 25 + 8 coefficients"),
        ({"G": plane(value=np.nan)}, "NaN or infinite"),
        ({"B": plane(value=-np.inf)}, "NaN or infinite"),
    ],
    ids=lambda value: str(value)[:30],
)
def test_wrong_pixels(damaged, planes, words):
    refused(damaged(planes=planes), words)


@pytest.mark.parametrize(("name", "value"), [("frame", "local"), ("center", "normal")])
def test_wrong_frames(damaged, name, value):
    refused(damaged({f"shrm:{name}": value}), "make it again")


def test_it_has_one_part(tmp_path):
    random_map().save(tmp_path / "a.exr")
    header, channels = parts(tmp_path / "a.exr")
    both = [OpenEXR.Part({**header, "name": name}, channels) for name in "ab"]
    OpenEXR.File(both).write(str(tmp_path / "b.exr"))
    refused(tmp_path / "b.exr", "2 parts")


def test_every_flipped_byte_is_survived(tmp_path):
    """Damage anywhere gives a map or a MapError, and nothing else."""
    random_map(2, 1).save(tmp_path / "a.exr")
    survives_flipped_bits(tmp_path / "a.exr", 400)
