"""Proxy boxes: rays that meet them, against marching along the rays."""

import numpy as np
import pytest

from shrm_cli.errors import ProbeError
from shrm_cli.maps.file import open_map
from shrm_cli.prefilter import prefilter
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.proxy import ProxyBox, carried
from tests.cli.helpers import done, noise, write_exr

BOX = ProxyBox.of([-1, 0, 2], [3, 2.5, 7], [0.5, 1.6, 3])


def units(rng, count):
    found = rng.standard_normal((count, 3))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def marched(box, point, direction):
    """Where a ray leaves the box, by bisection of the way along it."""
    near, far = 0.0, 100.0
    for _ in range(80):
        middle = (near + far) / 2
        place = point + middle * direction
        inside = all(box.low[k] <= place[k] <= box.high[k] for k in range(3))
        near, far = (middle, far) if inside else (near, middle)
    return point + near * direction


def test_directions_are_those_of_what_rays_meet(rng):
    points = rng.uniform(BOX.low, BOX.high, (300, 3))
    ways = units(rng, 300)
    ways[:40, 0] = 0.0  # parallel to two faces
    ways[20:40, 1] = -0.0
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    found = BOX.directions(points, ways)
    for point, way, direction in zip(points, ways, found, strict=True):
        expected = marched(BOX, point, way) - BOX.at
        np.testing.assert_allclose(direction, expected / np.linalg.norm(expected), atol=1e-9)
    np.testing.assert_allclose(BOX.directions(BOX.at, ways), ways, atol=1e-12)


def test_points_on_faces_and_outside_have_directions(rng):
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    corners = np.array(np.meshgrid(*zip(BOX.low, BOX.high, strict=True))).reshape(3, -1).T
    ways = np.concatenate([axes, units(rng, 50)])
    found = BOX.directions(corners[:, None], ways)
    np.testing.assert_allclose(np.linalg.norm(found, axis=-1), 1)
    outside = np.array([10.0, 1, 4])
    np.testing.assert_allclose(BOX.directions(outside, ways), BOX.directions([3, 1, 4], ways))
    # On a face, what leaves the box sees the point itself.
    face = np.array([3.0, 1, 4]) - BOX.at
    np.testing.assert_allclose(BOX.directions(outside, axes[0]), face / np.linalg.norm(face))


def test_along_a_face_the_rounding_of_shaders_turns_no_ray_into_it():
    floor = np.array([0.0, 0.0, 4.0])
    along = np.array([1.0, -np.finfo(np.float32).epsneg, 0.0])  # a shader's least part below 1
    far = np.array([3.0, 0.0, 4.0]) - BOX.at
    np.testing.assert_allclose(BOX.directions(floor, along), far / np.linalg.norm(far), atol=1e-6)


def test_the_least_rotation_carries_one_direction_to_another(rng):
    before, after, vectors = units(rng, 200), units(rng, 200), units(rng, 200)
    np.testing.assert_allclose(carried(before, before, after), after, atol=1e-9)
    axis = np.cross(before, after)
    np.testing.assert_allclose(carried(axis, before, after), axis, atol=1e-9)
    turned = carried(vectors, before, after)
    np.testing.assert_allclose((turned * after).sum(-1), (vectors * before).sum(-1), atol=1e-9)
    np.testing.assert_allclose((turned * axis).sum(-1), (vectors * axis).sum(-1), atol=1e-9)
    # Rodrigues' formula, by the cross product alone.
    sine = np.linalg.norm(axis, axis=1, keepdims=True)
    cosine, unit = (before * after).sum(-1, keepdims=True), axis / sine
    along = (unit * vectors).sum(-1, keepdims=True) * unit * (1 - cosine)
    expected = cosine * vectors + sine * np.cross(unit, vectors) + along
    np.testing.assert_allclose(turned, expected, atol=1e-9)


def test_a_box_turns_by_right_angles():
    quarter = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])  # +Z to +X
    found = BOX.turned(quarter)
    assert found == ProxyBox((3, 1.6, -0.5), (2, 0, -3), (7, 2.5, 1))
    slanted = np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]])
    assert BOX.turned(slanted) is None


@pytest.mark.parametrize(
    "wrong",
    [
        None, 3, [], {}, {"at": [0, 0, 0]}, {"at": 1, "min": 2, "max": 3},
        {"at": [0, 0, 0], "min": [-1, -1, -1], "max": [1, 1, "x"]},
        {"at": [0, 0, 0], "min": [-1, -1, -1], "max": [1, 1, 1e999]},
        {"at": [0, 0, 1], "min": [-1, -1, -1], "max": [1, 1, 1]},
        {"at": [0, 0, 0, 0], "min": [-1, -1, -1], "max": [1, 1, 1]},
        {"at": [0, 0], "min": [-1, -1], "max": [1, 1]},
    ],
)  # fmt: skip
def test_records_that_are_none_are_no_box(wrong):
    assert ProxyBox.read(wrong) is None
    assert ProxyBox.read(BOX.record()) == BOX


def test_impossible_boxes_are_refused():
    with pytest.raises(ProbeError, match="flat"):
        ProxyBox.of([0, 0, 0], [1, 0, 1])
    with pytest.raises(ProbeError, match="not within"):
        ProxyBox.of([0, 0, 0], [1, 1, 1], [1, 0.5, 0.5])
    assert ProxyBox.of([0, 0, 0], [1, 2, 4]).at == (0.5, 1, 2)


CORNERS, PLACE = [-1, 0, 2, 3, 2.5, 7], [0.5, 1.6, 3]


def test_light_files_have_the_box_of_their_probes(tmp_path):
    write_exr(tmp_path / "a.exr", noise(8, 16))
    one = f'[[probe]]\nfile = "a.exr"\nbox = {CORNERS}\nat = {PLACE}\n'
    disc = "[[disc]]\nazimuth = 0\nelevation = 0\nradius = 5\nradiance = 1\n"
    path = tmp_path / "light.toml"
    path.write_text(one + disc + '[[probe]]\nfile = "a.exr"\n')
    assert open_probe(path).proxy == BOX
    made = prefilter(open_probe(path), to="irradiance")
    assert made.info.proxy == BOX
    # A quarter turn takes +Z to +X, and +X to -Z.
    turned = open_probe(path, yaw=90).proxy
    expected = ProxyBox.of([2, 0, -3], [7, 2.5, 1], [3, 1.6, -0.5])
    for name in ("at", "low", "high"):
        np.testing.assert_allclose(getattr(turned, name), getattr(expected, name), atol=1e-12)
    slanted = open_probe(path, yaw=30)
    assert slanted.proxy is None
    assert "right angles" in slanted.report.notes[0]
    wider = open_probe(path, box=[-9, -9, -9, 9, 9, 9]).proxy
    assert (wider.at, wider.low) == (BOX.at, (-9, -9, -9))  # the place is still the probe's own
    path.write_text(one + one.replace("[-1,", "[-2,"))
    assert open_probe(path).proxy is None
    assert "differ" in open_probe(path).report.notes[0]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("box = [0, 0, 0, 1, 1]", "'box' must be 6 numbers"),
        ('box = "wide"', "'box' must be 6 numbers"),
        ("box = [0, 0, 0, 1, 1, nan]", "'box' must be 6 numbers"),
        ("box = [0, 0, 0, 1, 1, 0]", "flat"),
        ("box = [0, 0, 0, 1, 1, 1]\nat = [2, 0.5, 0.5]", "not within the box"),
        ("at = [0, 0, 0]", "needs the box"),
    ],
)
def test_wrong_boxes_of_light_files_are_refused(tmp_path, line, said):
    write_exr(tmp_path / "a.exr", noise(8, 16))
    (tmp_path / "light.toml").write_text(f'[[probe]]\nfile = "a.exr"\n{line}\n')
    with pytest.raises(ProbeError, match=said):
        open_probe(tmp_path / "light.toml")


def test_manifests_give_boxes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_exr("a.exr", noise(8, 16))
    entry = '[[entry]]\noutput = "{probe}.boxed.exr"\n'
    (tmp_path / "bake.toml").write_text(
        'probes = "a.exr"\nto = "irradiance"\noutput = "{probe}.plain.exr"\n'
        f"[[entry]]\n{entry}reading = {{ box = {CORNERS}, at = {PLACE} }}\n"
    )
    done("batch", "bake.toml", "--jobs", "1")
    assert open_map("a.boxed.exr").info.proxy == BOX
    assert open_map("a.plain.exr").info.proxy is None
    done("prefilter", "a.exr", "--to", "irradiance", "--box", ",".join(map(str, CORNERS)), "--at",
         ",".join(map(str, PLACE)), "-o", "alone.exr")  # fmt: skip
    assert (tmp_path / "alone.exr").read_bytes() == (tmp_path / "a.boxed.exr").read_bytes()
