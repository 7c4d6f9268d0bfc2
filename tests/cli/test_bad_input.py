"""Bad input of `shrm prefilter`: one line that says what to do, and no file left behind.

Files are tried in a process of its own: image libraries write to stderr past Python, and at the
end of the process.
"""

import os
import struct
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from tests.cli.helpers import (
    MAIN,
    NO_MODULES,
    UNPRIVILEGED,
    assert_refused,
    mounted,
    noise,
    process,
    read_exr,
    run,
    several,
    snapshot,
    write_exr,
)

HUGE = (200_000, 100_000)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Current folder with a sound probe."""
    write_exr(tmp_path / "probe.exr", noise())
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write_png(path):
    output = oiio.ImageOutput.create("x.png")
    assert output.open(str(path.with_suffix(".png")), oiio.ImageSpec(32, 16, 3, "uint8"))
    assert output.write_image((noise() * 100).astype(np.uint8))
    output.close()
    path.with_suffix(".png").rename(path)


def with_pixel(value):
    pixels = noise()
    pixels[5, 9, 1] = value
    return pixels


def with_windows(width, height):
    """A sound EXR whose header claims another size."""

    def make(path):
        write_exr(path, noise())
        data = bytearray(path.read_bytes())
        for name in (b"dataWindow\0box2i\0", b"displayWindow\0box2i\0"):
            at = data.index(name) + len(name) + 4
            struct.pack_into("<4i", data, at, 0, 0, width - 1, height - 1)
        path.write_bytes(data)

    return make


def image(height, width):
    return lambda path: write_exr(path, noise(height, width))


def cut(part):
    def make(path):
        write_exr(path, noise(64, 128))
        data = path.read_bytes()
        path.write_bytes(data[: int(part * len(data))])

    return make


# How to make the file, options, and what the line has to say.
FILES = {
    "missing": (lambda path: None, "no such file; check its name"),
    "directory": (Path.mkdir, "a directory; name an image file"),
    "empty": (Path.touch, "empty; copy or export it again"),
    "text": (lambda path: path.write_text("no image " * 99), "copy or export it again"),
    "truncated header": (cut(0.001), "copy or export it again"),
    "truncated pixels": (cut(0.5), "copy or export it again"),
    "last byte missing": (cut(0.9999), "damaged or truncated; copy or export it again"),
    "png renamed": (write_png, "named .exr, but it is a png file; rename it"),
    "1:1": (image(16, 16), "give --layout angular"),
    "3:2": (image(16, 24), "24 x 16 is no known layout", "give --layout"),
    "odd cube": (image(97, 16), "16 x 97 is no known layout", "give --layout"),
    "part of a panorama": (
        image(16, 64),
        "is no known layout",
        "put what is a part of a panorama into 64 x 32 pixels",
    ),
    "two pixels off": (image(32, 66), "is no known layout", "panorama into 66 x 33 pixels"),
    "of odd width": (image(8, 35), "is no known layout", "panorama into 36 x 18 pixels"),
    "a pixel off": (image(31, 63), "is no known layout", "scale it to 62 x 31"),
    "a pixel off, and small": (image(16, 33), "is no known layout", "scale it to 32 x 16"),
    "zero size": (with_windows(0, 0), "copy or export it again"),
    "huge": (with_windows(*HUGE), "bad.exr"),
    "nan": (
        lambda path: write_exr(path, with_pixel(np.nan)),
        "1 pixel is NaN or infinite, the first at column 9, row 5; give --fix-nonfinite",
    ),
    "inf": (
        lambda path: write_exr(path, with_pixel(-np.inf)),
        "1 pixel is NaN or infinite, the first at column 9, row 5; give --fix-nonfinite",
    ),
    "beyond float": (
        lambda path: write_exr(path, np.full((16, 32, 3), 3e38, np.float32)),
        "its light is beyond 32-bit floats; dim it, or give --clamp",
    ),
}


@pytest.fixture(scope="module")
def unusable(tmp_path_factory):
    """What is said of each of the files, by a single process, and what there was and is then."""
    folder = tmp_path_factory.mktemp("unusable")
    names = {case: case.replace(" ", "-").replace(":", "-") + ".exr" for case in FILES}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for case, (make, *_) in FILES.items():
            make(folder / names[case])
        before = snapshot(folder)
        commands = [("prefilter", name, "--brdf", "lambertian") for name in names.values()]
        found = dict(zip(FILES, several(*commands), strict=True))
    return names, found, before, snapshot(folder)


@pytest.mark.parametrize("case", FILES)
def test_unusable_probes(unusable, case):
    names, found, before, after = unusable
    _, *parts = FILES[case]
    parts = [part.replace("bad.exr", names[case]) for part in parts]
    assert_refused(found[case], 1, f"Error: {names[case]}: ", *parts)
    assert "; " in found[case].err  # what is wrong; what to do
    assert after == before


@pytest.mark.parametrize(("name", "said"), [("a.txt", "coefficients"), ("a.toml", "a light file")])
def test_images_named_as_text(folder, name, said):
    """What codecs say of bytes means nothing to whoever named a file wrongly."""
    write_exr("a.exr", noise())
    Path("a.exr").rename(name)
    result = run("prefilter", name, "--brdf", "lambertian")
    assert_refused(result, 1, f"{name}: no text, so that it", said)
    assert "codec" not in result.err


def test_a_file_that_begins_as_an_option(folder):
    write_exr("-d.exr", noise())
    result = run("prefilter", "-d.exr", "--brdf", "lambertian")
    assert_refused(result, 2, "No such option '-d'; the file of that name is ./-d.exr")
    assert run("prefilter", "./-d.exr", "--brdf", "lambertian").code == 0


@pytest.mark.parametrize("layout", ["openexr", "strip", "hcross", "vcross", "angular", "latlong"])
def test_layouts_that_do_not_fit(folder, layout):
    write_exr("bad.exr", noise(17, 31))
    before = snapshot(folder)
    result = run("prefilter", "bad.exr", "--brdf", "phong", "--layout", layout)
    assert_refused(result, 1, "bad.exr: 31 x 17 cannot be", layout, "give the --layout")
    assert snapshot(folder) == before


@pytest.mark.parametrize(
    ("arguments", "text", "said"),
    [
        (
            ["info", "a.toml"], '[[disc]]\ndirection = ["x", 1, 2]\nradius = 3\nradiance = 1\n',
            "a.toml: disc 1: 'direction' must be a number",
        ),
        (
            ["info", "a.toml"], '[[probe]]\nfile = "a.exr"\nyaw = nan\n',
            "a.toml: probe 1: 'yaw' must be a finite number",
        ),
        (
            ["batch", "a.toml"], 'probes = ["a.exr"]\nbrdfs = ["phong"]\neps = 7\n',
            "a.toml: 'eps' 7 is not a number",
        ),
    ],
)  # fmt: skip
def test_keys_of_files_are_no_flags(tmp_path, monkeypatch, arguments, text, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.toml").write_text(text)
    write_exr("a.exr", np.ones((4, 8, 3), np.float32))
    result = run(*arguments)
    assert_refused(result, 1, said)
    assert "--" not in result.err


def test_integers_want_linearize(folder):
    write_png(folder / "ldr.png")
    before = snapshot(folder)
    result = process("prefilter", "ldr.png", "--brdf", "lambertian")
    assert_refused(result, 1, "ldr.png: uint8 pixels", "give --linearize")
    assert snapshot(folder) == before
    assert run("prefilter", "ldr.png", "--brdf", "lambertian", "--linearize").code == 0


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="no /proc to measure with")
def test_a_huge_header_costs_no_memory(folder):
    with_windows(*HUGE)(folder / "bad.exr")
    # getrusage would count what was inherited from this process.
    code = f"""
import atexit
atexit.register(lambda: print(open("/proc/self/status").read().split("VmHWM:")[1].split()[0]))
{MAIN}"""
    result = process("prefilter", "bad.exr", "--brdf", "lambertian", code=code)
    assert result.code == 1
    assert int(result.out) < 200_000  # kB; importing the libraries takes 80 MB


def test_nonfinite_pixels_can_be_filled(folder):
    write_exr("bad.exr", with_pixel(np.nan))
    result = run("prefilter", "bad.exr", "--brdf", "lambertian", "--fix-nonfinite")
    assert result.code == 0
    assert result.err == ("Warning: bad.exr: 1 NaN or infinite pixel was filled from neighbours\n")


def test_black_is_allowed_with_a_warning(folder):
    write_exr("black.exr", np.zeros((16, 32, 3), np.float32))
    result = run("prefilter", "black.exr", "--brdf", "microfacet", "-o", "out.exr")
    assert result.code == 0
    assert result.err == "Warning: black.exr: the probe is black\n"
    assert all((pixels == 0).all() for pixels in read_exr("out.exr")[1].values())


def test_negative_radiance_is_clamped_with_a_warning(folder):
    write_exr("negative.exr", with_pixel(-2.5))
    result = process("prefilter", "negative.exr", "--brdf", "phong", "-o", "out.exr")
    assert result.code == 0
    assert result.err == (
        "Warning: negative.exr: 1 pixel with negative radiance was clamped to 0 (minimum -2.5)\n"
    )
    write_exr("zero.exr", with_pixel(0))
    assert run("prefilter", "zero.exr", "--brdf", "phong", "-o", "expected.exr").code == 0
    found, expected = read_exr("out.exr")[1], read_exr("expected.exr")[1]
    assert all(np.array_equal(found[name], expected[name]) for name in expected)


ARGUMENTS = [
    (["--brdf", "microfact"], 1, ["'microfact'", "did you mean microfacet"]),
    (["--brdf", "LAMBERT"], 1, ["'LAMBERT'", "did you mean lambertian or"]),
    (["--brdf", "qqq"], 1, ["'qqq'", "known: ashikhmin-shirley, blinn-phong, charlie"]),
    (["--brdf", ""], 1, ["no BRDF is called ''", "known: "]),
    (["--brdf", "phong:shine=3"], 1, ["phong: unknown parameter 'shine'", "it has exponent"]),
    (["--brdf", "microfacet:sigma=2"], 1, ["sigma=2 is outside 0.005 .. 1"]),
    (["--brdf", "phong:exponent=-0.1"], 1, ["exponent=-0.1 is outside 0 .. 100000"]),
    (["--brdf", "lambertian:albedo=1.01"], 1, ["albedo=1.01 is outside 0 .. 1"]),
    (["--brdf", "phong:exponent=nan"], 1, ["exponent=nan is not a number"]),
    (["--brdf", "phong:exponent=x"], 1, ["exponent=x is not a number"]),
    (["--brdf", "phong:exponent"], 1, ["expected key=value, got 'exponent'"]),
    (["--brdf", "phong:"], 1, ["expected key=value"]),
    (["--brdf", "phong:exponent=3,"], 1, ["expected key=value"]),
    (["--brdf", "phong:=3"], 1, ["expected key=value, got '=3'"]),
    (["--brdf", "phong:exponent=3,exponent=4"], 1, ["exponent is given twice"]),
    (["--brdf", "phong", "--eps", "0"], 2, ["'--eps': 0 is not between 0 and 1"]),
    (["--brdf", "phong", "--eps", "1"], 2, ["'--eps': 1 is not between 0 and 1"]),
    (["--brdf", "phong", "--error", "5"], 2, ["1, neither included; 5 % are 0.05"]),
    (["--brdf", "phong", "--eps", "nan"], 2, ["'--eps': nan is not between 0 and 1"]),
    (["--brdf", "phong", "--eps", "-0.1"], 2, ["'--eps': -0.1 is not between 0 and 1"]),
    (["--brdf", "phong", "--eps", "3%"], 2, ["'--eps': '3%' is not a number"]),
    (["--brdf", "phong", "--order-f", "513"], 2, ["'--order-f': 513", "0<=x<=512"]),
    (["--brdf", "phong", "--order-f", "-1"], 2, ["'--order-f': -1", "0<=x<=512"]),
    (["--brdf", "phong", "--order-f", "1.5"], 2, ["'--order-f': '1.5'"]),
    (["--brdf", "phong", "--order-p", "33"], 2, ["'--order-p': 33", "0<=x<=32"]),
    (["--brdf", "phong", "--order-p", "-1"], 2, ["'--order-p': -1", "0<=x<=32"]),
    (["--brdf", "phong", "--size", "0"], 2, ["'--size': 0", "4<=x<=4096"]),
    (["--brdf", "phong", "--size", "5000"], 2, ["'--size': 5000", "4<=x<=4096"]),
    (["--brdf", "phong", "--frame", "world"], 2, ["'--frame': 'world'", "'global', 'local'"]),
    (["--brdf", "phong", "--precision", "16"], 2, ["'--precision'", "'half'"]),
    (["--brdf", "phong", "--to", "cubemap"], 2, ["'--to': 'cubemap'", "shrm"]),
    (["--brdf", "phong", "--sampling", "middle"], 2, ["'--sampling'", "'border'"]),
    (["--brdf", "phong", "--yaw", "nan"], 2, ["'--yaw'", "finite"]),
    (["--brdf", "phong", "--clamp", "0"], 2, ["'--clamp'", "positive"]),
    (["--brdf", "phong", "--clamp", "inf"], 2, ["'--clamp'", "positive"]),
    (["--brdf", "phong", "--siez", "32"], 2, ["No such option '--siez'", "'--size'"]),
    (["--brdf"], 2, ["requires an argument", "shrm prefilter --help"]),
    (["--brdf", "phong", "-x"], 2, ["No such option '-x'", "shrm prefilter --help"]),
    ([], 2, ["--brdf is missing", "shrm prefilter --help"]),
]


@pytest.mark.parametrize(("arguments", "code", "parts"), ARGUMENTS, ids=lambda value: str(value))
def test_wrong_arguments(folder, arguments, code, parts):
    before = snapshot(folder)
    assert_refused(run("prefilter", "probe.exr", *arguments), code, *parts)
    assert snapshot(folder) == before


@pytest.mark.slow
def test_a_tolerance_that_cannot_be_met_gives_the_best_map(folder, rng):
    """exp(-F^2 / s) of the energy is beyond F = 512, s = 1e5: 0.073 (eq. 5.28)."""
    noise = 0.4 + 0.6 * rng.random((128, 256, 3))
    write_exr(folder / "noise.exr", noise.astype(np.float32))
    result = process(
        "prefilter", "noise.exr", "--brdf", "phong:exponent=1e5", "--eps", "0.001", "-o", "m.exr"
    )
    assert result.code == 0
    (line,) = result.err.splitlines()
    assert "of the picture is predicted to be wrong by more than 5 %" in line
    assert "--to auto" in line
    assert (folder / "m.exr").stat().st_size < 32e6


def refused_output(folder, output, *parts, code=None):
    """No output is made, no temporary is left; with code, a process that begins with it."""
    before = snapshot(folder)
    command = ("prefilter", "probe.exr", "--brdf", "phong", "-o", output)
    result = run(*command) if code is None else process(*command, code=f"{code}\n{MAIN}")
    assert_refused(result, 1, f"Error: {output}: ", *parts)
    assert snapshot(folder) == before


def test_outputs_that_cannot_be_made(folder):
    (folder / "sub").mkdir()
    refused_output(folder, "no/out.exr", "there is no folder no; make it first")
    refused_output(folder, "sub", "a directory; name a file")
    refused_output(folder, "probe.exr/out.exr", "probe.exr is a file, not a folder; name another")
    refused_output(folder, f"{'n' * 300}.exr", "File name too long", "name another")


def test_outputs_that_are_the_input(folder):
    (folder / "link.exr").symlink_to("probe.exr")
    (folder / "hard.exr").hardlink_to("probe.exr")
    for name in ("probe.exr", f"../{folder.name}/probe.exr", "link.exr", "hard.exr"):
        refused_output(folder, name, "would overwrite the input; name another output")


def test_the_input_through_a_link_is_not_overwritten_either(folder):
    (folder / "link.exr").symlink_to("probe.exr")
    before = snapshot(folder)
    result = run("prefilter", "link.exr", "--brdf", "phong", "-o", "probe.exr")
    assert_refused(result, 1, "probe.exr: would overwrite the input")
    assert snapshot(folder) == before


def test_one_of_six_files_is_not_overwritten(folder):
    for face in ("+X", "-X", "+Y", "-Y", "+Z", "-Z"):
        write_exr(f"sky_{face}.exr", np.ones((4, 4, 3), np.float32))
    before = snapshot(folder)
    result = run("prefilter", "sky_%.exr", "--brdf", "phong", "-o", "sky_-Y.exr")
    assert_refused(result, 1, "sky_-Y.exr: would overwrite the input")
    assert snapshot(folder) == before


def test_a_pipe_is_not_replaced(folder):
    os.mkfifo(folder / "pipe.exr")
    refused_output(folder, "pipe.exr", "not a regular file; name another output")
    assert (folder / "pipe.exr").is_fifo()


@pytest.mark.parametrize(
    "words",
    [
        ("info", "NAME"),
        ("grid", "NAME", "-o", "out.npz"),
        ("prefilter", "probe.exr", "--brdf", "./NAME", "-o", "out.exr"),
        ("export", "probe.exr", "--for", "gltf", "--into", "NAME", "-o", "out"),
    ],
    ids=lambda words: words[0],
)
@pytest.mark.parametrize("name", ["pipe.npz", "pipe.bsdf", "endless.npz"])
def test_pipes_and_devices_are_not_read(folder, words, name):
    """A pipe that nobody writes to would be waited for, and zeros without end fill the memory."""
    os.mkfifo(folder / name) if "pipe" in name else (folder / name).symlink_to("/dev/zero")
    before = snapshot(folder)
    limits = "import resource, signal; resource.setrlimit(resource.RLIMIT_AS, (2**32, 2**32)); "
    limits += "signal.alarm(20); "
    result = process(*(each.replace("NAME", name) for each in words), code=limits + MAIN)
    assert_refused(result, 1, f"{name}: not a regular file; name ")
    assert snapshot(folder) == before


@pytest.mark.parametrize(
    "words", [("info",), ("convert", "--to", "strip", "-o", "out.exr"), ("render", "-o", "out.png")]
)
def test_input_without_permission(folder, words):
    """It is no wrong usage, which --help would explain."""
    (folder / "probe.exr").chmod(0)
    result = process(words[0], "probe.exr", *words[1:], code=UNPRIVILEGED + MAIN)
    assert_refused(result, 1, "Error: probe.exr: no permission to read it; change its mode")


def test_folder_without_permission(folder):
    (folder / "sub").mkdir(mode=0o555)
    refused_output(
        folder, "sub/out.exr", "no permission to write in sub; name another", code=UNPRIVILEGED
    )


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="no /proc")
def test_folder_that_nobody_can_write(folder):
    refused_output(folder, "/proc/out.exr", "name another output")


def test_read_only_file_system(folder):
    with mounted(folder / "sub", "ro"):
        refused_output(folder, "sub/out.exr", "no permission to write in sub; name another")


def test_full_disk(folder):
    with mounted(folder / "sub", "size=16k"):
        result = process(
            "prefilter", "probe.exr", "--brdf", "phong", "-o", "sub/out.exr", "--size", "256",
            "--precision", "float",
        )  # fmt: skip
        assert_refused(
            result, 1, "Error: sub/out.exr: cannot be written (No space left on device); make room"
        )
        assert snapshot(folder / "sub") == {}


@pytest.mark.parametrize(("limit", "old"), [(0, "old"), (300, None), (3000, "old")])
@pytest.mark.slow
def test_file_that_would_grow_too_large(folder, limit, old):
    """As on a full disk: in the first byte, in the header, in the pixels."""
    if old is not None:
        (folder / "out.exr").write_text(old)
    code = f"{NO_MODULES}; import resource as r; r.setrlimit(r.RLIMIT_FSIZE, ({limit}, {limit}))"
    refused_output(folder, "out.exr", "cannot be written (File too large); make room", code=code)


def test_half_that_overflows(folder):
    write_exr("sun.exr", np.full((16, 32, 3), 1e5, np.float32))
    before = snapshot(folder)
    result = run("prefilter", "sun.exr", "--brdf", "lambertian", "--precision", "half")
    parts = ["sun.lambertian.shrm.exr: the value 354491 overflows half (65504)", "use --precision"]
    assert_refused(result, 1, *parts)
    assert snapshot(folder) == before


def test_failure_leaves_an_old_output_as_it_was(folder):
    (folder / "out.exr").write_text("old")
    write_exr("bad.exr", with_pixel(np.nan))
    before = snapshot(folder)
    assert run("prefilter", "bad.exr", "--brdf", "phong", "-o", "out.exr").code == 1
    assert snapshot(folder) == before


@pytest.mark.parametrize("arguments", [
    ["prefilter", "--to", "splitsum"], ["prefilter", "--to", "she"],
    ["prefilter", "--brdf", "ggx:roughness=0.6"], ["prefilter", "--to", "irradiance"],
    ["export", "--for", "bevy"], ["export", "--for", "three"], ["info"], ["sun"],
])  # fmt: skip
def test_light_beyond_floats_names_the_probe(tmp_path, monkeypatch, arguments):
    monkeypatch.chdir(tmp_path)
    write_exr("huge.exr", np.full((16, 32, 3), 3e38, np.float32))
    command, *options = arguments
    found = run(command, "huge.exr", *options)
    assert_refused(found, 1, "Error: huge.exr: its light is beyond 32-bit floats", "--clamp")
    assert os.listdir() == ["huge.exr"]


def test_no_map_is_written_whose_error_is_no_number(tmp_path, monkeypatch):
    """The squares of 1e30 are beyond 32-bit floats: readers would refuse the file."""
    monkeypatch.chdir(tmp_path)
    image = np.full((64, 128, 3), 0.1, np.float32)
    image[10:12, 10:12] = 1e30
    write_exr("spot.exr", image)
    found = run("prefilter", "spot.exr", "--brdf", "lambertian", "--to", "principal")
    assert_refused(found, 1, "Error: spot.exr: the error of its map", "--clamp")
    assert os.listdir() == ["spot.exr"]
