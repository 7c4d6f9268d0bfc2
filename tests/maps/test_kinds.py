"""The three kinds of maps: what `shaded` makes of each."""

from dataclasses import replace

import numpy as np
import pytest

from shrm_cli.errors import ArgumentError, MapError
from shrm_cli.maps.kinds import LightMap, MaterialMap, ReflectionMap
from shrm_cli.maps.lamps.map import LampMap
from tests.maps.shader import cases

FORMS = {**cases.FORMS, "irradiance": lambda: cases.irradiance(2)}


@pytest.mark.parametrize("name", FORMS)
def test_a_map_is_reflected_light_or_light_for_a_surface(name):
    made, (normals, views) = FORMS[name](), cases.points(9)
    assert isinstance(made, ReflectionMap) != isinstance(made, LightMap)
    assert isinstance(made, LightMap) == name.startswith(("splitsum", "she"))
    shown = made.shaded(0.5, (1.0, 1.0, 1.0))
    if isinstance(made, LampMap):  # whose pictures integrate lamps in single precision
        assert shown.map is made.map
    else:
        assert (shown is made) == isinstance(made, ReflectionMap)
    if name in ("splitsum linear", "she lobe"):
        np.testing.assert_array_equal(made.radiance(normals, views), shown.radiance(normals, views))


PLAIN = [
    name for name in FORMS if not name.startswith(("lamps", "splitsum cloth", "splitsum about"))
]


@pytest.mark.parametrize("name", PLAIN)
def test_another_record_changes_nothing_else(name):
    made, (normals, views) = FORMS[name](), cases.points(9)
    found = made.with_info(replace(made.info, probe="other.exr"))
    assert (type(found), found.info.probe) == (type(made), "other.exr")
    np.testing.assert_array_equal(found.radiance(normals, views), made.radiance(normals, views))


def test_materials_reflect_nothing_before_they_are_lit():
    lit = cases.FORMS["product"]()
    material = lit.product
    assert isinstance(material, MaterialMap)
    for asked in (material.shaded, lambda: material.radiance([0, 0, 1], [0, 0, 1])):
        with pytest.raises(MapError, match="holds no light"):
            asked()
    points, again = cases.points(9), material.lit(2 * lit.lighting)
    np.testing.assert_allclose(again.radiance(*points), 2 * lit.radiance(*points), rtol=1e-12)


@pytest.mark.parametrize("name", ["she lobe", "splitsum cloth"])
def test_only_split_sums_of_ggx_are_brushed(name):
    with pytest.raises(MapError, match="anisotropy is of split sums of GGX"):
        FORMS[name]().shaded(0.5, (1.0, 1.0, 1.0), anisotropy=0.5)
    shown = FORMS["splitsum linear"]().shaded(0.5, (1.0, 1.0, 1.0), anisotropy=0.5, taps=8)
    assert (shown.anisotropy, shown.taps) == (0.5, 8)


@pytest.mark.parametrize("name", ["splitsum linear", "she lobe"])
def test_a_reflectance_may_be_one_number(name):
    made, points = FORMS[name](), cases.points(9)
    for grey in (0.04, np.float32(0.04), [0.04]):
        found = made.shaded(0.5, grey).radiance(*points)
        expected = made.shaded(0.5, (0.04, 0.04, 0.04)).radiance(*points)
        np.testing.assert_allclose(found, expected, rtol=1e-6)
    for wrong in ((0.04, 1.0), "gold"):
        with pytest.raises(MapError, match="f0 must be one number or three"):
            made.shaded(0.5, wrong)


@pytest.mark.parametrize("taps", [-1, 4, 8.5, "5"])
def test_numbers_of_taps_that_nobody_fitted_are_refused(taps):
    made = FORMS["splitsum linear"]()
    with pytest.raises(ArgumentError, match="with anisotropy give 3, 5 or 8"):
        made.shaded(0.5, anisotropy=0.5, taps=taps)
    with pytest.raises(ArgumentError, match="without anisotropy give 0, 1, 2 or 3"):
        made.shaded(0.5, taps=taps)


def test_no_taps_are_of_surfaces_that_are_not_brushed():
    with pytest.raises(ArgumentError, match="with anisotropy give 3, 5 or 8"):
        FORMS["splitsum linear"]().shaded(0.5, anisotropy=0.5, taps=0)


@pytest.mark.parametrize("name", sorted(FORMS))
def test_every_form_refuses_what_are_no_directions(name):
    made, up = FORMS[name](), [0.0, 1.0, 0.0]
    for normals, views, said in (
        ("up", up, "`normals` are no numbers"),
        (up, np.ones((4, 2)), "`views` of shape .4, 2. are no vectors"),
        (np.ones((4, 3)), np.ones((5, 3)), "`views` of shape .5, 3. do not go with normals"),
        (np.zeros((4, 3)), up, "`normals` hold .0.0, 0.0, 0.0., whose length is 0"),
        (up, [up, [0, np.nan, 1]], "`views` hold .0.0, nan, 1.0., whose length"),
        (up, [up, [0, 1e200, 1]], "`views` hold .0.0, 1e.200, 1.0., whose length"),
    ):
        with pytest.raises(ArgumentError, match=said):
            made.radiance(normals, views)
