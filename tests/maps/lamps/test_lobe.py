"""Tables of what BRDFs without code reflect of lamps, beside the BRDFs, and in files."""

import json
from dataclasses import replace

import numpy as np
import OpenEXR
import pytest

from shrm_cli.brdf.lobe import cuts_horizon
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import MapError
from shrm_cli.maps.file import open_map
from shrm_cli.maps.lamps.lobe import TABLE_BYTES, LobeTable, bytes_of_table
from tests.brute_force import unit
from tests.maps.lamps.test_map import made

SPECS = {
    "lobe": "lafortune:fit=primer",
    "normal": "oren-nayar:sigma=0.5",
    "sum": "0.3*phong:exponent=30+0.5*lafortune:fit=clay",
}


def with_table(spec):
    """A map with lamps that a table reflects, whose BRDF nobody else knows."""
    own = made({"name": "measured", "parameters": {"file": "gone.bsdf", "sha256": 64 * "0"}})
    return replace(own, known=LobeTable.of(parse_spec(spec)))


@pytest.mark.parametrize("spec", SPECS.values(), ids=SPECS)
def test_its_error_is_that_of_random_directions(rng, spec):
    """Of lights and views in which it has not been looked for."""
    brdf = parse_spec(spec)
    table = LobeTable.of(brdf)
    light, view = unit(rng, 100_000), unit(rng, 100_000)
    if cuts_horizon(brdf):  # Phong's lobe goes on below it
        light[:, 2], view[:, 2] = np.abs(light[:, 2]), np.abs(view[:, 2])
    truth = brdf.transfer(light, view)
    wrong = table.transfer(light, view) - truth
    measured = np.sqrt(np.sum(wrong**2) / np.sum(truth**2))
    assert table.error(brdf) == pytest.approx(measured, rel=0.15)


@pytest.mark.parametrize("spec", SPECS.values(), ids=SPECS)
def test_a_file_brings_it_back(tmp_path, rng, spec):
    """Without the BRDF, and as exactly as half precision holds it."""
    path, before = tmp_path / "map.exr", with_table(spec)
    before.save(path, "half")
    after = open_map(path)
    points = unit(rng, 200), unit(rng, 200)
    found, expected = after.lamps.radiance(*points), before.lamps.radiance(*points)
    assert expected.max() > 0.01
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-6 * expected.max())
    again = tmp_path / "again.exr"
    after.save(again, "half")
    assert again.read_bytes() == path.read_bytes()
    with OpenEXR.File(str(path)) as file:
        assert file.header()["shrm:version"] == 7  # which readers of lamps alone refuse


def test_forms_and_layouts_take_it_along(tmp_path, rng):
    points, path = (unit(rng, 50), unit(rng, 50)), tmp_path / "map.exr"
    before = with_table("lafortune:fit=primer")
    for layout in ("openexr", "hcross", "latlong"):
        before.converted("shrm").save(path, "float", layout=layout)
        after = open_map(path)
        np.testing.assert_array_equal(after.lamps.radiance(*points), before.lamps.radiance(*points))


@pytest.mark.parametrize(
    "change",
    [
        lambda attributes: attributes.pop("shrm:scale"),
        lambda attributes: attributes.update({"shrm:scale": 0.0}),
        lambda attributes: attributes.update({"shrm:scale": float("inf")}),
        lambda attributes: attributes.update({"shrm:brdf_table": "{}"}),
        lambda attributes: attributes.update(
            {"shrm:brdf_table": attributes["shrm:brdf_table"].replace("reflection", "tangent")}
        ),
        lambda attributes: attributes.update(
            {"shrm:brdf_table": moved(attributes["shrm:brdf_table"])}
        ),
    ],
)
def test_a_table_that_lies_is_refused(tmp_path, change):
    path = tmp_path / "map.exr"
    with_table("lafortune:fit=primer").save(path, "half")
    with OpenEXR.File(str(path)) as file:
        parts = [OpenEXR.Part(dict(part.header), part.channels, part.name()) for part in file.parts]
        change(parts[-1].header)
        parts[0].header.pop("shrm:digest")
        OpenEXR.File(parts).write(str(path))
    with pytest.raises(MapError, match="the table of what its lamps' BRDF reflects is wrong"):
        open_map(path)


def moved(text):
    """Settings whose nodes are others than those that shaders know."""
    held = json.loads(text)
    held["axes"]["theta_h"][5] *= 1.01
    return json.dumps(held)


def test_what_has_a_table():
    for name in ("lobe", "sum"):
        assert bytes_of_table(parse_spec(SPECS[name])) == TABLE_BYTES
    for spec in ("ggx", SPECS["normal"]):
        assert bytes_of_table(parse_spec(spec)) == 0
    assert bytes_of_table(parse_spec("kajiya-kay")) is None  # which is about the tangent
    assert bytes_of_table(parse_spec("poulin-fournier")) is None  # brushed
