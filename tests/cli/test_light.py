"""`shrm light edit` and `shrm light basis`: files, pictures and errors."""

import json

import numpy as np
import pytest

from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import open_probe
from shrm_cli.vocabulary import PRIMARIES
from tests.cli.helpers import MESH, done, noise, run
from tests.cli.test_render import read
from tests.probe import scenes

LIGHT = np.random.default_rng(6).normal(size=(9, 3))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Current folder with light and a mesh."""
    np.save(tmp_path / "a.npy", LIGHT)
    np.save(tmp_path / "wide.npy", np.ones((25, 3)))
    scenes.write(tmp_path / "room.exr", noise(16, 32))
    (tmp_path / "a.toml").write_text('[[probe]]\nfile = "room.exr"\n')
    (tmp_path / "b.toml").write_text("[[disc]]\nazimuth = 1\nelevation = 3\nradius = 9\n"
                                     "radiance = 2\n")  # fmt: skip
    (tmp_path / "roof.obj").write_text(MESH)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def light(name, order=2):
    return project(open_probe(name), order).coefficients


def test_coefficients_are_edited_and_added(folder):
    done("light", "edit", "a.npy", "--set", "1,-1=-2", "--scale", "2,1,1", "--add", "wide.npy",
         "-o", "b.json")  # fmt: skip
    expected = np.ones((25, 3))
    changed = LIGHT.copy()
    changed[1] = -2
    expected[:9] += changed * [2, 1, 1]
    np.testing.assert_allclose(light("b.json", 4), expected, rtol=1e-13)


def test_lights_of_other_primaries_are_converted(folder):
    """White of the same luminance stays; so does red, by other numbers."""
    red = np.zeros((9, 3))
    red[0, 0] = 1.0
    np.save("red.npy", red)
    (folder / "p3.toml").write_text(
        'working = "p3"\n[[sh]]\nfile = "red.npy"\nprimaries = "p3"\n[[sh]]\nfile = "a.npy"\n'
        'primaries = "p3"\n'
    )
    done("light", "edit", "a.npy", "--add", "p3.toml", "--order", "2", "-o", "b.npy")
    expected = LIGHT + (red + LIGHT) @ matrix_of("p3", "rec709").T
    np.testing.assert_allclose(light("b.npy"), expected, atol=1e-9)
    told = run("light", "edit", "p3.toml", "-o", "c.npy")
    assert "coefficients are in P3, which their file cannot say" in told.err
    np.testing.assert_allclose(light("c.npy"), red + LIGHT, atol=1e-12)


def matrix_of(source, target):
    """From RGB to XYZ and back, by the definition of primaries and white."""

    def to_xyz(name):
        points = np.reshape(PRIMARIES[name], (4, 2))
        columns = np.array([[x / y, 1.0, (1 - x - y) / y] for x, y in points]).T
        return columns[:, :3] * np.linalg.solve(columns[:, :3], columns[:, 3])

    return np.linalg.solve(to_xyz(target), to_xyz(source))


def test_an_image_becomes_coefficients(folder):
    done("light", "edit", "room.exr", "--rotate", "y:90", "--order", "6", "-o", "b.txt")
    expected = project(open_probe("room.exr", yaw=90.0), 6).coefficients
    np.testing.assert_allclose(light("b.txt", 6), expected, atol=1e-12)


def test_what_is_given_twice_is_done_twice(folder):
    """In the order of the command line, in which the first ones were dropped without a word."""
    twice = "--rotate", "y:70", "--scale", "2", "--rotate", "x:40", "--scale", "3,1,0.5"
    done("light", "edit", "a.npy", *twice, "-o", "both.npy")
    done("light", "edit", "a.npy", *twice[:4], "-o", "first.npy")
    done("light", "edit", "first.npy", *twice[4:], "-o", "then.npy")
    np.testing.assert_allclose(light("both.npy", 2), light("then.npy", 2), atol=1e-12)
    done("light", "edit", "a.npy", *twice[4:], *twice[:4], "-o", "other.npy")
    assert np.abs(light("other.npy", 2) - light("both.npy", 2)).max() > 0.1


@pytest.mark.parametrize("name", ["room.exr", "a.npy"])
def test_images_and_coefficients_are_scaled_in_a_light_file(folder, name):
    """What brings a probe into the range of a format is one command, and loses no pixel."""
    done("light", "edit", name, "--scale", "1e4", "-o", "c.toml")
    np.testing.assert_allclose(light("c.toml"), 1e4 * light(name), rtol=1e-9, atol=1e-7)
    assert name in (folder / "c.toml").read_text()


def test_numbers_are_written_without_what_rounding_adds(folder):
    """0.3 times 0.3 is 0.09 in a file that people read, not 0.09000000000000000..."""
    (folder / "disc.toml").write_text("[[disc]]\nazimuth = 1\nelevation = 3\nradius = 9\n"
                                      "radiance = 0.3\n")  # fmt: skip
    done("light", "edit", "disc.toml", "--scale", "0.3", "-o", "c.toml")
    assert "radiance = [0.09, 0.09, 0.09]" in (folder / "c.toml").read_text()


def test_a_light_file_stays_one(folder):
    done("light", "edit", "a.toml", "--rotate", "y:90", "--add", "b.toml", "--add", "a.npy",
         "--add", "room.exr", "-o", "c.toml")  # fmt: skip
    room = project(open_probe("room.exr", yaw=90.0), 2).coefficients
    expected = room + light("b.toml") + LIGHT + light("room.exr")
    np.testing.assert_allclose(light("c.toml"), expected, atol=1e-10)
    facts = open_probe("c.toml").images[0].facts()
    assert (len(facts["probes"]), len(facts["discs"]), facts["order"]) == (2, 1, 2)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["a.npy", "-o", "b.png"], "b.png"),
        (["a.npy", "--set", "1,2=3", "-o", "b.txt"], "1,2: a degree L has orders M from -L to L"),
        (["a.npy", "--set", "3,0=1", "-o", "b.txt"], "no coefficient 3,0; raise --order"),
        (["a.npy", "--dim", "3,4", "-o", "b.txt"], "is not AZ,EL:X or AZ,EL:X:W"),
        (["a.npy", "--dim", "3,4:0.1:0", "-o", "b.txt"], "a width outside 0.001 .. 180"),
        (["a.npy", "--rotate", "y:1e9", "-o", "b.txt"], "'y:1e9' turns by more than 1e+06 degrees"),
        (["a.npy", "--dim", "1e9,4:0.1", "-o", "b.txt"], "azimuth 1e+09 of '1e9,4' is beyond"),
        (["a.npy", "--scale", "-1", "-o", "b.txt"], "below 0"),
        (["a.toml", "--dim", "3,4:0.1", "-o", "b.toml"], "is not dimmed in a light file"),
        (["a.toml", "--order", "3", "-o", "b.toml"], "--order applies to coefficients"),
        (["a.toml", "-o", "sub/b.toml"], "a.toml: a light file names what lies beside it"),
        (["none.npy", "-o", "b.txt"], "none.npy: no such file"),
    ],
)
def test_what_is_wrong_is_said_in_a_line(folder, arguments, said):
    (folder / "sub").mkdir()
    result = run("light", "edit", *arguments)
    assert result.code != 0
    assert said in result.err.splitlines()[-1]
    assert not [*folder.glob("b.txt"), *folder.glob("sub/*")]


def test_the_basis_is_white_whatever_was_baked(folder):
    """The object had the albedo of its transfer, and the textures of its mesh."""
    pictures = []
    for albedo in ("0.2", "0.7,0.1,0.4"):
        few = ("--samples", "64", "--order", "2", "--albedo", albedo)
        done("transfer", "roof.obj", *few, "-o", "roof.npz", "--force")
        options = ("--order", "1", "--size", "32", "--transfer", "roof.npz", "--view", "0,80")
        done("light", "basis", "roof.obj", *options, "-o", "a.exr")
        pictures.append(read("a.exr"))
    np.testing.assert_array_equal(*pictures)
    done(
        "light",
        "basis",
        "roof.obj",
        "--order",
        "0",
        "--size",
        "32",
        "--view",
        "0,80",
        "-o",
        "b.exr",
    )
    free, shadowed = read("b.exr")[..., 1].max(), pictures[0][:32, :32, 1].max()
    assert 0.9 * free < shadowed <= 1.01 * free


@pytest.mark.parametrize("transfer", [False, True])
def test_pictures_of_the_basis(folder, transfer):
    """A roof from above: the light of y makes it brighter, and from below it makes it darker."""
    options = ["roof.obj", "--order", "1", "--size", "32", "--columns", "4"]
    if transfer:
        done("transfer", "roof.obj", "--samples", "64", "--order", "2", "-o", "roof.npz")
        options += ["--transfer", "roof.npz"]
    said = json.loads(done("light", "basis", *options, "--view", "0,80", "-o", "a.exr", "--json"))
    assert said["names"] == ["0,0", "1,-1", "1,0", "1,1"]
    found = read("a.exr")
    assert found.shape[:2] == (said["height"], said["width"])
    red, green, blue = np.moveaxis(found[:32, said["width"] // 4 : said["width"] // 2], -1, 0)
    inside = green > red
    assert inside.mean() > 0.1
    assert blue[inside].max() < 0.01
    done("light", "basis", *options[1:5], "-o", "ball.png")
