"""`shrm export`: files, folder, what is said, and what is refused in one line."""

import json
import re
import sys

import numpy as np
import OpenEXR
import pytest

import shrm_cli as shrm
from shrm_cli.errors import OutputError
from shrm_cli.export import make
from shrm_cli.maps.file import open_map
from shrm_cli.maps.splitsum import prefilter
from shrm_cli.probe.options import ReadOptions
from shrm_cli.vocabulary import ENGINES, PRIMARIES
from tests.cli.helpers import MAIN, assert_refused, done, noise, process, run, snapshot, write_exr
from tests.export.readers import read_ktx1, read_ktx2
from tests.web.glb import ball_file


@pytest.fixture
def folder(tmp_path, rng, monkeypatch):
    """Return a folder with a probe, which is the current one."""
    monkeypatch.chdir(tmp_path)
    write_exr(tmp_path / "sky.exr", rng.uniform(0.1, 2, size=(32, 64, 3)).astype(np.float32))
    return tmp_path


def test_the_folder_has_the_names_of_probe_and_engine(folder):
    out = done("export", "sky.exr", "--for", "filament", "--size", "32", "--skybox", "0")
    assert out.startswith("sky.filament: Filament\n")
    assert "sky_ibl.ktx" in out
    assert "nine coefficients" in out
    files = {path.name for path in (folder / "sky.filament").iterdir()}
    assert files == {"sky_ibl.ktx", "sh.txt", "sky_README.md"}
    assert len(read_ktx1((folder / "sky.filament" / "sky_ibl.ktx").read_bytes()).mips) == 2


def test_json_lists_the_files(folder):
    text = done("export", "sky.exr", "--for", "godot", "-o", "assets", "--json")
    result = json.loads(text)
    assert (result["engine"], result["folder"]) == ("godot", "assets")
    for each in result["files"]:
        assert (folder / "assets" / each["name"]).stat().st_size == each["bytes"]
    assert result["told"]
    assert result["loading"]
    assert result["warnings"] == []


def test_the_same_export_is_the_same_bytes(folder):
    done("export", "sky.exr", "--for", "bevy", "--size", "16", "-o", "a")
    done("export", "sky.exr", "--for", "bevy", "--size", "16", "-o", "b")
    assert snapshot(folder / "a") == snapshot(folder / "b")
    done("export", "sky.exr", "--for", "bevy", "--size", "16", "-o", "a")


def test_a_light_goes_into_a_copy_of_a_gltf_file(folder):
    (folder / "ball.glb").write_bytes(ball_file(1.0, 0.5, rows=4))
    before = (folder / "ball.glb").read_bytes()
    export = ["export", "sky.exr", "--for", "gltf", "--size", "32", "--into", "ball.glb"]
    out = done(*export)
    assert "sky_ball.glb" in out
    done(*export)  # the same again
    again = [*export[:-3], "64", *export[-2:]]
    assert_refused(run(*again), 1, "--force")
    done(*again, "--force")
    json_file = run("export", "sky.exr", "--for", "json", "--into", "ball.glb")
    assert_refused(json_file, 2, "--into does not apply")
    assert_refused(run(*export[:-1], "no.glb"), 1, "no.glb: no such file; name a glTF file")
    (folder / "ball.obj").write_text("v 0 0 0\n")
    assert_refused(run(*export[:-1], "ball.obj"), 1, "ball.obj: no glTF file; export it as glTF 2")
    assert (folder / "ball.glb").read_bytes() == before


def test_lamps_are_spread_where_the_engine_filters(folder):
    light = np.full((128, 256, 3), 0.5, np.float32)
    light[30, 40] = 1e4
    write_exr(folder / "sun.exr", light)
    out = done("export", "sun.exr", "--for", "godot", "--firefly-safe")
    assert "1 lamp is spread over a radius of" in out
    assert "the pixels are too large for discs of 1 degrees" in out
    assert "% RMS from GGX's lobe" not in out  # which were measured of such discs
    out = done("export", "sky.exr", "--for", "godot", "--firefly-safe")
    assert "no lamp is spread, as none is smaller than a radius of" in out
    assert "roughness 0.14" not in out
    refused = run("export", "sky.exr", "--for", "unreal", "--firefly-safe")
    assert_refused(refused, 2, "--firefly-safe does not apply; Unreal has no sampler that is known")


def test_several_engines_get_what_each_gets_alone(folder):
    out = done("export", "sky.exr", "--for", "json", "--for", "godot", "-o", "assets")
    assert "assets/json: JSON" in out
    assert "assets/godot: Godot" in out
    for name in ("json", "godot"):
        done("export", "sky.exr", "--for", name)
        assert snapshot(folder / "assets" / name) == snapshot(folder / f"sky.{name}")
    done("export", "sky.exr", "--for", "json", "--for", "godot")  # they are there already


def test_all_engines(folder):
    result = json.loads(done("export", "sky.exr", "--for", "all", "--size", "32", "--json"))
    assert [each["engine"] for each in result["exports"]] == list(ENGINES)
    assert result["failures"] == []
    assert {path.name for path in folder.iterdir()} == {
        "sky.exr", *(f"sky.{name}" for name in ENGINES)
    }  # fmt: skip


def test_what_is_wrong_with_the_light_is_said_once(folder):
    """Seventeen engines told the same of one pixel."""
    pixels = np.ones((8, 16, 3), np.float32)
    pixels[3, 5] = np.nan
    write_exr(folder / "nan.exr", pixels)
    result = run("export", "nan.exr", "--for", "json", "--for", "godot", "-o", "assets")
    assert (result.code, result.out) == (1, "")
    (line,) = result.err.splitlines()
    assert line.startswith("Failed: json and godot: nan.exr: 1 pixel is NaN")
    assert not (folder / "assets").exists()


def test_engines_of_one_format_have_it_as_the_automatic_one(folder):
    given = ("export", "sky.exr", "--for", "bevy", "--for", "json", "--for", "unity")
    result = json.loads(done(*given, "--size", "16", "--format", "auto", "-o", "a", "--json"))
    assert result["failures"] == []
    done(*given, "--size", "16", "-o", "b")
    for name in ("json/sky_sh.json", "unity/sky_latlong.exr"):
        assert (folder / "a" / name).read_bytes() == (folder / "b" / name).read_bytes()


@pytest.mark.parametrize(
    ("option", "having"),
    [
        (["--max-error", "0.2"], "bevy"),
        (["--format", "rgb9e5"], "bevy"),
        (["--skybox", "8"], "filament and bevy"),
        (["--firefly-safe"], "unity"),
        (["--sun", "split"], "filament and bevy"),
        (["--window", "none"], "filament, json and unity"),
    ],
)
def test_what_some_engines_have_not_is_for_the_others(folder, option, having):
    """--for all --firefly-safe failed for all but two engines, and the command with them."""
    given = ["export", "sky.exr", "--size", "32", *option, "-o", "a"]
    names = ["filament", "bevy", "json", "unity"]
    if "--max-error" in option:
        names.remove("filament")
    several = [*given, *(word for name in names for word in ("--for", name))]
    assert f"{option[0]} is for {having}; the others have none" in done(*several)
    told = json.loads(done(*several, "--json"))
    assert told["failures"] == []
    assert list(told["options_of_some"]) == [option[0][2:]]


def test_what_no_engine_has_is_refused(folder):
    given = ["export", "sky.exr", "--for", "json", "--for", "unreal"]
    for option in (["--max-error", "0.2"], ["--format", "bc6h"], ["--dfg"], ["--into", "a.glb"]):
        assert_refused(run(*given, *option), 2, option[0])


def test_an_engine_that_has_not_what_is_asked_loses_no_other(folder):
    given = ("export", "sky.exr", "--for", "gltf", "--for", "bevy", "--size", "16", "-o", "assets")
    result = run(*given)
    assert result.code == 1
    assert result.err.startswith("Failed: gltf: --size must be 32 at least")
    assert [path.name for path in (folder / "assets").iterdir()] == ["bevy"]
    assert run(*given, "--size", "9", "-o", "none").code == 1
    assert not (folder / "none").exists()


def test_what_is_wrong_with_a_probe_is_said_once_for_all_engines(folder):
    result = run("export", "none.exr", "--for", "all", "-o", "assets")
    assert_refused(result, 1, "none.exr: no such file")
    assert result.err.count("none.exr") == 1
    assert not (folder / "assets").exists()


def test_a_probe_is_read_once_for_all_engines(folder, monkeypatch):
    opened, given = [], make.as_probe
    monkeypatch.setattr(make, "as_probe", lambda *args: opened.append(args) or given(*args))
    done("export", "sky.exr", "--for", "json", "--for", "godot", "--for", "usd")
    assert len(opened) == 1


def test_the_only_format_of_an_engine_may_be_named(folder):
    given = ("export", "sky.exr", "--for", "cesium", "--size", "16")
    done(*given)
    done(*given, "--format", "rgba16f", "--max-error", ".01")  # the same bytes, or it would refuse
    assert_refused(run(*given, "--max-error", "1e-9"), 2, "--max-error 1e-09 is not kept: rgba16f")
    assert_refused(run(*given, "--format", "bc6h"), 2, "CesiumJS reads rgba16f, auto")


def test_gltf_sample_viewer_gets_no_pixel_that_it_skips(folder):
    """It looks a panorama up at the texels of a cube of 256, and would miss a lamp of a pixel."""
    light = np.ones((1024, 2048, 3), np.float32)
    light[300, 600] = 101
    write_exr(folder / "lamp.exr", light)
    done("export", "lamp.exr", "--for", "gltf-sample-viewer", "--size", "32")
    data = (folder / "lamp.gltf-sample-viewer" / "lamp.hdr").read_bytes()
    start = data.index(b"-Y 512 +X 1024\n") + len(b"-Y 512 +X 1024\n")
    pixels = np.frombuffer(data, np.uint8, offset=start).reshape(512, 1024, 4).astype(float)
    image = pixels[..., :3] * np.exp2(pixels[..., 3:] - 136)
    assert image[150, 300] == pytest.approx(1 + 100 / 4, rel=0.01)


def test_engines_share_what_is_made_of_a_probe_and_get_the_same_bytes(folder, monkeypatch):
    write_exr(folder / "sky.exr", noise(128, 256))  # fewer rows would be cut for each
    made, given = [], prefilter.to_grid
    monkeypatch.setattr(prefilter, "to_grid", lambda *args: made.append(args) or given(*args))
    several = [word for each in ("bevy", "cesium", "directx") for word in ("--for", each)]
    done("export", "sky.exr", *several, "--size", "16", "-o", "all")
    assert len(made) == 1
    for name in ("bevy", "cesium", "directx"):
        done("export", "sky.exr", "--for", name, "--size", "16")
        assert snapshot(folder / "all" / name) == snapshot(folder / f"sky.{name}")


def test_probes_of_other_primaries_are_not_shared(folder):
    """What is known of their own light is not what is known of the light that engines get."""
    given = ReadOptions(primaries=PRIMARIES["acescg"])
    source = make.Source.open(["sky.exr"], reading=given)
    assert source.for_several() is source
    plain = make.Source.open(["sky.exr"])
    assert plain.for_several().probe is not plain.probe


def test_a_turned_probe_is_turned(folder):
    done("export", "sky.exr", "--for", "bevy", "--size", "16", "-o", "plain")
    done("export", "sky.exr", "--for", "bevy", "--size", "16", "--yaw", "180", "-o", "turned")
    plain, turned = (
        read_ktx2((folder / name / "sky_specular.ktx2").read_bytes()).mips[1]
        for name in ("plain", "turned")
    )
    # +X and -X change places; the rows of their faces stay.
    assert (np.abs(turned[0] - plain[1]) < 0.02 * plain[1]).all()
    assert np.abs(turned[0] - plain[0]).max() > 0.02


def test_a_chain_of_cloth_is_written_for_readers_of_it_alone(folder):
    done(
        "prefilter", "sky.exr", "--to", "splitsum", "--brdf", "charlie", "--levels", "2", "--size",
        "32", "-o", "cloth.exr",
    )  # fmt: skip
    done("export", "cloth.exr", "--for", "gltf-sample-viewer", "-o", "a")
    assert "charlie: textureLod" in (folder / "a" / "cloth_README.md").read_text()
    assert {path.name for path in (folder / "a").iterdir()} == {
        "cloth_charlie.ktx2", "cloth_README.md",
    }  # fmt: skip
    made = open_map("cloth.exr")
    found = read_ktx2((folder / "a" / "cloth_charlie.ktx2").read_bytes()).mips
    assert [mip.shape[1] for mip in found] == [32, 16]
    # Where the sampler's faces meet those of the map, their means are the same light.
    assert found[0].mean() == pytest.approx(made.levels[0].mean(), rel=1e-3)
    refused = run("export", "cloth.exr", "--for", "filament", "-o", "b")
    assert_refused(refused, 1, "is of charlie; Filament reads split sums of GGX")
    refused = run("export", "cloth.exr", "--for", "gltf-sample-viewer", "--dfg", "-o", "b")
    assert_refused(refused, 2, "shrm dfg --brdf charlie")
    refused = run("export", "cloth.exr", "--for", "gltf-sample-viewer", "--size", "64", "-o", "b")
    assert_refused(refused, 1, "--to splitsum --brdf charlie --mapping linear --levels 3 --mips")
    assert not (folder / "b").exists()


@pytest.mark.parametrize("engine", ["filament", "babylon", "playcanvas"])
def test_a_split_sum_is_taken_as_it_is_where_it_is_made_as_the_refusal_says(folder, engine):
    done("prefilter", "sky.exr", "--to", "splitsum", "--levels", "9", "--size", "32", "-o", "a.exr")
    refused = run("export", "a.exr", "--for", engine)
    command = re.search(r"shrm (prefilter PROBE [^ ]*.*), or export", refused.err)[1]
    done(*command.replace("PROBE", "sky.exr").split(), "-o", "b.exr")
    assert "interpolated" not in done("export", "b.exr", "--for", engine)


def test_cloth_has_colours_of_its_own(folder):
    out = done(
        "prefilter", "sky.exr", "--to", "splitsum", "--brdf", "charlie", "--levels", "2", "--size",
        "16", "-o", "cloth.exr",
    )  # fmt: skip
    assert "split sum of charlie, 2 levels" in out
    result = json.loads(
        done("compare", "cloth.exr", "--probe", "sky.exr", "--roughness", "1", "--json", "--size",
             "24", "--view", "0,0", "--no-picture", "--no-flip")
    )  # fmt: skip
    assert result["brdf"] == {"name": "charlie", "parameters": {"roughness": 1.0, "color": 1.0}}
    assert "f0" not in result
    assert result["summary"][0]["relative_rmse"] < 0.2
    assert_refused(run("render", "cloth.exr", "--f0", "gold"), 2, "--f0 applies to maps of GGX")


def test_maps_are_converted(folder):
    done(
        "prefilter", "sky.exr", "--to", "splitsum", "--mapping", "filament", "--levels", "2",
        "--size", "32",
    )  # fmt: skip
    done("prefilter", "sky.exr", "--to", "irradiance")
    done("export", "sky.splitsum.exr", "sky.irradiance.exr", "--for", "filament", "-o", "maps")
    done("export", "sky.exr", "--for", "filament", "--size", "32", "-o", "probe")
    ours, theirs = (folder / name / "sh.txt" for name in ("maps", "probe"))
    assert ours.read_text() == theirs.read_text()
    one, other = (
        read_ktx1((folder / name / "sky_ibl.ktx").read_bytes()) for name in ("maps", "probe")
    )
    assert one.pairs == other.pairs
    assert (np.abs(one.mips[0] - other.mips[0]) < 0.04 * other.mips[0]).all()


@pytest.mark.parametrize(
    ("arguments", "code", "part"),
    [
        (["sky.exr"], 2, "Missing option '--for'"),
        (["sky.exr", "--for", "quake"], 2, "'quake' is not one of"),
        (["sky.exr", "sky.exr", "--for", "godot"], 2, "sky.exr is a probe; export it alone"),
        (["missing.exr", "sky.exr", "--for", "godot"], 1, "missing.exr: no such file"),
        (["sky.exr", "--for", "filament", "--size", "100"], 2, "--size 100 is no power of two"),
        (["sky.exr", "--for", "bevy", "--format", "r11g11b10"], 2, "--format r11g11b10 does not"),
        (["sky.exr", "--for", "three", "--skybox", "8"], 2, "--skybox does not apply"),
        (["sky.exr", "--for", "godot", "-o", "sky.exr"], 1, "sky.exr"),
        (["sky.exr", "--for", "godot", "-o", "no/such"], 1, "there is no folder no"),
        (["none.exr", "--for", "godot"], 1, "none.exr"),
        (["bad.exr", "--for", "godot"], 1, "bad.exr"),
        (["nan.exr", "--for", "godot"], 1, "--fix-nonfinite"),
        (["sky.exr", "--for", "filament", "--window", "wide"], 2, "wide"),
        (["sky.exr", "--for", "three", "--max-error", "nan"], 2, "nan is not between 0 and 1"),
    ],
)
def test_bad_input_is_one_line(folder, arguments, code, part):
    (folder / "bad.exr").write_bytes(b"no image at all")
    pixels = np.ones((8, 16, 3), dtype=np.float32)
    pixels[2, 3] = np.nan
    write_exr(folder / "nan.exr", pixels)
    before = snapshot(folder)
    assert_refused(run("export", *arguments), code, part)
    assert snapshot(folder) == before


def test_a_map_is_not_read_like_a_probe(folder):
    done("prefilter", "sky.exr", "--to", "irradiance")
    done("prefilter", "sky.exr", "--to", "she")
    refused = run("export", "sky.irradiance.exr", "--for", "filament", "--yaw", "3")
    assert_refused(refused, 2, "--yaw applies to probes")
    assert_refused(run("export", "sky.she.exr", "--for", "filament"), 1, "she is not what engines")


def test_other_exports_are_kept_unless_forced(folder):
    done("export", "sky.exr", "--for", "godot", "-o", "out")
    before = snapshot(folder)
    again = ["export", "sky.exr", "--for", "godot", "-o", "out", "--size", "16"]
    assert_refused(run(*again), 1, "sky_panorama.exr: exists", "--force")
    assert snapshot(folder) == before
    done(*again, "--force")
    assert snapshot(folder) != before


def test_an_export_of_another_light_or_engine_is_kept_before_the_work(folder, monkeypatch):
    done("export", "sky.exr", "--for", "godot", "-o", "out")
    readme = folder / "out" / "sky_README.md"
    whole = readme.read_bytes()
    done("export", "sky.exr", "--for", "godot", "-o", "out")  # the same again
    for damaged in (whole[:7], whole[:20] + bytes(len(whole) - 20), b""):
        readme.write_bytes(damaged)
        done("export", "sky.exr", "--for", "godot", "-o", "out")
        assert readme.read_bytes() == whole
    before = snapshot(folder)
    with monkeypatch.context() as patch:
        patch.setattr(make, "packaged", None)  # no work begins
        again = ["export", "sky.exr", "--for", "unity", "-o", "out"]
        assert_refused(run(*again), 1, "sky_README.md: exists", "--force")
        with pytest.raises(OutputError, match="exists"):
            shrm.export("sky.exr", "unity", "out")
    assert snapshot(folder) == before
    (folder / "out" / "note.txt").write_text("mine")  # is beside nothing of the export
    done(*again, "--force")


def test_an_input_in_the_folder_is_not_replaced(folder, rng):
    write_exr(folder / "a_panorama.exr", rng.uniform(size=(8, 16, 3)).astype(np.float32))
    (folder / "a.exr").symlink_to("a_panorama.exr")
    refused = run("export", "a.exr", "--for", "godot", "-o", ".", "--force")
    assert_refused(refused, 1, "would overwrite the input")


def test_clipping_is_one_warning(folder):
    pixels = np.ones((32, 64, 3), dtype=np.float32)
    pixels[4, 5] = 2e5
    write_exr(folder / "sun.exr", pixels)
    result = run("export", "sun.exr", "--for", "filament", "--size", "32", "--skybox", "0")
    assert result.code == 0
    assert result.err.count("Warning: sun_ibl.ktx: texels brighter than") == 1
    assert "--clamp" in result.err
    clamped = run(
        "export", "sun.exr", "--for", "filament", "--size", "32", "--skybox", "0", "--clamp", "100",
        "-o", "dim",
    )  # fmt: skip
    assert "brighter" not in clamped.err


def test_negative_radiance_is_told(folder):
    pixels = np.ones((16, 32, 3), dtype=np.float32)
    pixels[4, 5] = -1
    write_exr(folder / "dark.exr", pixels)
    result = run("export", "dark.exr", "--for", "godot")
    assert result.code == 0
    assert "negative" in result.err


def test_engines_get_colours_of_rec709(folder, rng):
    """From a probe in ACEScg and from its maps, the same numbers as from one in Rec.709."""
    colour = pytest.importorskip("colour", reason="no colour-science")
    source = colour.RGB_COLOURSPACES["ACEScg"]
    matrix = colour.matrix_RGB_to_RGB(source, "ITU-R BT.709", "Bradford")
    # Pale colours, which Rec.709 has too: negative ones would be clamped in one of the probes.
    pixels = 1 + 0.2 * rng.uniform(size=(32, 64, 3))
    said = {"chromaticities": PRIMARIES["acescg"]}
    write_exr(folder / "wide.exr", pixels.astype(np.float32), **said)
    write_exr(folder / "plain.exr", (pixels @ matrix.T).astype(np.float32))

    def coefficients(*arguments):
        told = done("export", *arguments, "--for", "json", "--force", "-o", "out")
        (path,) = (folder / "out").glob("*.json")
        values = json.loads(path.read_text())["radiance"]
        path.unlink()
        return told, np.array(values)

    told, plain = coefficients("plain.exr")
    assert "colours:" not in told
    told, wide = coefficients("wide.exr")
    assert "from ACEScg to linear Rec.709" in told
    np.testing.assert_allclose(wide, plain, rtol=0, atol=1e-5)
    told, kept = coefficients("wide.exr", "--working", "acescg")
    assert "in ACEScg; engines take numbers for Rec.709" in told
    np.testing.assert_allclose(kept @ matrix.T, plain, rtol=0, atol=1e-5)
    assert np.abs(kept - plain).max() > 1e-3
    done("prefilter", "wide.exr", "--to", "irradiance")
    told, of_map = coefficients("wide.irradiance.exr")
    assert "from ACEScg to linear Rec.709" in told
    np.testing.assert_allclose(of_map, plain, rtol=0, atol=1e-5)


@pytest.mark.skipif(sys.platform == "win32", reason="has no such limits")
@pytest.mark.slow
def test_a_full_disk_leaves_no_folder(folder):
    """A limit on files' sizes is as good as a full disk; the first file may be small enough."""
    code = f"import resource, signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n{MAIN}"
    code = code.replace(MAIN, f"resource.setrlimit(resource.RLIMIT_FSIZE, (2500, 2500))\n{MAIN}")
    (folder / "old").mkdir()
    before = snapshot(folder)
    for name in ("new", "old"):
        result = process(
            "export", "sky.exr", "--for", "filament", "--size", "32", "-o", name, code=code
        )
        assert_refused(result, 1, f"{name}/sky_ibl.ktx: cannot be written", "make room")
    assert snapshot(folder) == before
    assert not (folder / "new").exists()
    assert not list((folder / "old").iterdir())


@pytest.mark.parametrize(
    ("engine", "name", "is_clipped"),
    [
        ("usd", "sun_dome.exr", False),
        ("blender", "sun_world.exr", False),
        ("unity", "sun_latlong.exr", True),
        ("godot", "sun_panorama.exr", True),
    ],
)
def test_light_beyond_half_precision_is_kept_where_floats_are_rendered(
    folder, engine, name, is_clipped
):
    """Engines keep panoramas in halves, where it would become infinite."""
    pixels = np.full((32, 64, 3), 0.5, np.float32)
    pixels[10, 20] = 291880, 250000, 70000
    write_exr(folder / "sun.exr", pixels)
    made = run("export", "sun.exr", "--for", engine, "-o", "out")
    assert made.code == 0
    assert ("brighter than RGBA16F holds (65504) were clipped" in made.err) == is_clipped
    assert ("clipped" in made.err) == is_clipped
    written = OpenEXR.File(str(folder / "out" / name)).channels()["RGB"].pixels
    assert written.dtype == (np.float16 if is_clipped else np.float32)
    most = [65504] * 3 if is_clipped else [291880, 250000, 70000]
    np.testing.assert_array_equal(written.max(axis=(0, 1)), most)


def test_a_stage_of_light_beyond_half_precision_is_the_same_light(folder):
    pixels = np.full((32, 64, 3), 0.5, np.float32)
    pixels[10, 20] = 291880
    write_exr(folder / "sun.exr", pixels)
    assert run("export", "sun.exr", "--for", "usd", "-o", "out").code == 0
    before, after = (
        np.array(json.loads(run("info", each, "--json").out)["mean"])
        for each in ("sun.exr", "out/sun.usda")
    )
    np.testing.assert_allclose(after, before, rtol=0.02)


def test_light_that_halves_hold_is_exported_in_halves(folder):
    write_exr(folder / "dim.exr", np.full((32, 64, 3), 0.5, np.float32))
    assert run("export", "dim.exr", "--for", "usd", "-o", "out").code == 0
    written = OpenEXR.File(str(folder / "out" / "dim_dome.exr")).channels()["RGB"].pixels
    assert written.dtype == np.float16
