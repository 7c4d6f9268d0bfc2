"""Every kind of file that can hold a probe: its pixels come back as they were written."""

import copy
import pickle  # noqa: TID251 (of its own objects)
from pathlib import Path

import numpy as np
import OpenEXR
import OpenImageIO as oiio
import pytest

from shrm_cli.errors import ProbeError
from shrm_cli.probe import image_file, reader
from shrm_cli.probe.image_file import ImageFile
from tests.probe import scenes

WIDTH, HEIGHT = 48, 24


@pytest.fixture
def image(rng):
    return rng.uniform(0.01, 20, (HEIGHT, WIDTH, 3)).astype(np.float32)


@pytest.fixture
def in_unit_range(rng):
    return rng.uniform(0, 1, (HEIGHT, WIDTH, 3))


def read(path, **options):
    file = ImageFile.open(path, **options)
    pixels = file.read(0, file.height)
    assert pixels.dtype == np.float32
    assert pixels.shape == (file.height, file.width, 3)
    return pixels


def linear(values):
    """IEC 61966-2-1, one value at a time."""
    return np.array(
        [v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4 for v in values.ravel()]
    ).reshape(values.shape)


@pytest.mark.parametrize("kind", ["half", "float"])
@pytest.mark.parametrize("tile", [0, 16, 64])
@pytest.mark.parametrize("compression", ["none", "rle", "zips", "zip", "piz"])
def test_exr(tmp_path, image, kind, tile, compression):
    path = scenes.write(tmp_path / "a.exr", image, kind, tile, compression=compression)
    expected = image.astype(np.float16) if kind == "half" else image
    np.testing.assert_array_equal(read(path), expected)


@pytest.mark.parametrize("tile", [0, 16])
def test_rows_are_read_in_any_order(tmp_path, image, tile):
    file = ImageFile.open(scenes.write(tmp_path / "a.exr", image, "float", tile))
    assert file.row_multiple == max(tile, 1)
    for start, stop in ((20, 24), (0, 1), (7, 19), (15, 17), (0, HEIGHT), (23, 24)):
        np.testing.assert_array_equal(file.read(start, stop), image[start:stop])


def test_mip_mapped_exr(tmp_path, image):
    """Level 0 counts. The levels of OpenImageIO's textures."""
    path = tmp_path / "a.exr"
    source = oiio.ImageBuf(image)
    assert oiio.ImageBufAlgo.make_texture(oiio.MakeTxTexture, source, str(path))
    assert oiio.ImageInput.open(str(path)).seek_subimage(0, 2)
    np.testing.assert_array_equal(read(path), image)
    np.testing.assert_array_equal(ImageFile.open(path).read(5, 20), image[5:20])


def test_first_part_of_a_multi_part_exr(tmp_path, image):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    parts = []
    for name, pixels in (("beauty", image), ("other", image[::-1] + 1)):
        planes = {c: np.ascontiguousarray(p) for c, p in scenes.rgb(pixels).items()}
        parts.append(OpenEXR.Part({**header, "name": name}, planes))
    with OpenEXR.File(parts) as file:
        file.write(str(tmp_path / "a.exr"))
    np.testing.assert_array_equal(read(tmp_path / "a.exr"), image)


@pytest.mark.parametrize("name", ["Y", "L", "luminance", "beauty.Y"])
def test_one_channel_serves_as_three(tmp_path, image, name):
    path = scenes.write_exr(tmp_path / "a.exr", {name: image[..., 1]})
    np.testing.assert_array_equal(read(path), image[..., [1, 1, 1]])


def test_luminance_beside_alpha_and_depth(tmp_path, image):
    planes = {"Y": image[..., 1], "A": image[..., 0], "Z": image[..., 2]}
    path = scenes.write_exr(tmp_path / "a.exr", planes)
    np.testing.assert_array_equal(read(path), image[..., [1, 1, 1]])


@pytest.mark.parametrize(
    "names",
    [("A", "R", "G", "B"), ("alpha", "red", "green", "blue"), ("b", "g", "r", "zAlpha.A")],
    ids=str,
)
def test_alpha_first_or_last_is_ignored(tmp_path, image, names):
    """Even where it is 0."""
    ramp = np.linspace(0, 1, WIDTH * HEIGHT, dtype=np.float32).reshape(HEIGHT, WIDTH)
    planes = dict.fromkeys(names, ramp)
    for name in names:
        if name[0].lower() in "rgb":
            planes[name] = image[..., "rgb".index(name[0].lower())]
    np.testing.assert_array_equal(read(scenes.write_exr(tmp_path / "a.exr", planes)), image)


def test_alpha_of_a_float_tiff_is_ignored(tmp_path, image):
    """Which it calls unassociated."""
    alpha = np.linspace(0, 1, WIDTH * HEIGHT, dtype=np.float32).reshape(HEIGHT, WIDTH, 1)
    pixels = np.concatenate([image, alpha], axis=-1)
    path = scenes.write(tmp_path / "a.tif", pixels, oiio__UnassociatedAlpha=1)
    assert oiio.ImageInput.open(str(path)).spec().nchannels == 4
    np.testing.assert_array_equal(read(path), image)


def test_unassociated_alpha_does_not_darken(tmp_path, rng):
    pixels = rng.integers(0, 256, (4, 8, 4), dtype=np.uint8)
    path = scenes.write_png(tmp_path / "a.png", pixels)
    expected = linear(pixels[..., :3] / 255)
    np.testing.assert_allclose(read(path, linearize=True), expected, atol=1e-6)


@pytest.mark.parametrize("pattern", ["ViewLayer.Combined.{}", "left.{}", "a.b c.{}"])
def test_layered_names(tmp_path, image, pattern):
    planes = scenes.rgb(image, pattern) | {pattern.format("A"): 0 * image[..., 0]}
    np.testing.assert_array_equal(read(scenes.write_exr(tmp_path / "a.exr", planes)), image)


def test_spelled_out_names(tmp_path, image):
    planes = dict(zip(("red", "green", "blue"), np.moveaxis(image, -1, 0), strict=True))
    np.testing.assert_array_equal(read(scenes.write_exr(tmp_path / "a.exr", planes)), image)


def test_layers_are_not_mixed(tmp_path, image):
    """R of one layer goes with G and B of the same; a layer without a name comes first."""
    planes = {"mask.R": image[..., 0] + 5, "mask.A": image[..., 0]} | scenes.rgb(image, "z.{}")
    np.testing.assert_array_equal(read(scenes.write_exr(tmp_path / "a.exr", planes)), image)
    planes = scenes.rgb(image + 5, "A.{}") | scenes.rgb(image)
    np.testing.assert_array_equal(read(scenes.write_exr(tmp_path / "b.exr", planes)), image)


def test_integer_channels_beside_the_colours_do_not_matter(tmp_path, image):
    planes = scenes.rgb(image.astype(np.float16)) | {"id": (image[..., 0] * 100).astype(np.uint32)}
    path = scenes.write_exr(tmp_path / "a.exr", planes, np.float16)
    np.testing.assert_array_equal(read(path), image.astype(np.float16))


def test_integer_colours_beside_float_depth_are_refused(tmp_path, image):
    planes = scenes.rgb((image * 1e6).astype(np.uint32)) | {"Z": image[..., 0]}
    path = scenes.write_exr(tmp_path / "a.exr", planes)
    with pytest.raises(ProbeError, match=r"uint.*`linearize`"):
        ImageFile.open(path)


@pytest.mark.parametrize("tile", [0, 16])
@pytest.mark.parametrize(
    ("x", "y", "display"),
    [(3, 2, (0, 0, 60, 40)), (-5, -4, (0, 0, 30, 12)), (-8, 3, (0, 0, 70, 20)),
     (100, 200, (110, 190, 20, 30)), (0, 0, (100, 100, 10, 10))],
    ids=["smaller", "larger", "wider but lower", "offset", "apart"],
)  # fmt: skip
def test_data_window_against_display_window(tmp_path, image, tile, x, y, display):
    """The display window is the image; what no data covers is black."""
    left, top, width, height = display
    spec = oiio.ImageSpec(WIDTH, HEIGHT, 3, oiio.FLOAT)
    spec.x, spec.y = x, y
    spec.full_x, spec.full_y, spec.full_width, spec.full_height = display
    spec.tile_width = spec.tile_height = tile
    path = tmp_path / "a.exr"
    output = oiio.ImageOutput.create(str(path))
    output.open(str(path), spec)
    output.write_image(image)
    output.close()
    expected = np.zeros((height, width, 3))
    for row in range(height):
        for column in range(width):
            i, j = row + top - y, column + left - x
            if 0 <= i < HEIGHT and 0 <= j < WIDTH:
                expected[row, column] = image[i, j]
    file = ImageFile.open(path)
    assert (file.width, file.height) == (width, height)
    np.testing.assert_array_equal(file.read(0, height), expected)
    for start in range(0, height, 5):
        stop = min(start + 5, height)
        np.testing.assert_array_equal(file.read(start, stop), expected[start:stop])


@pytest.mark.parametrize(("envmap", "expected"), [("LATLONG", "latlong"), ("CUBE", "cube")])
def test_envmap_attribute(tmp_path, image, envmap, expected):
    """The data window of an environment map is its image, wherever it lies."""
    window = (np.array([4, 6], "i4"), np.array([4 + WIDTH - 1, 6 + HEIGHT - 1], "i4"))
    path = scenes.write_exr(
        tmp_path / "a.exr",
        scenes.rgb(image),
        envmap=getattr(OpenEXR, f"ENVMAP_{envmap}"),
        dataWindow=window,
        displayWindow=(np.array([0, 0], "i4"), np.array([99, 99], "i4")),
    )
    file = ImageFile.open(path)
    assert (file.envmap, file.border_sampled) == (expected, True)
    np.testing.assert_array_equal(file.read(0, file.height), image)


def test_plain_files_are_no_environment_maps(tmp_path, image):
    file = ImageFile.open(scenes.write(tmp_path / "a.exr", image))
    assert (file.envmap, file.border_sampled, file.chromaticities) == ("", False, None)
    assert file.file_format == "openexr"


def test_chromaticities(tmp_path, image):
    rec2020 = (0.708, 0.292, 0.17, 0.797, 0.131, 0.046, 0.3127, 0.329)
    path = scenes.write_exr(tmp_path / "a.exr", scenes.rgb(image), chromaticities=rec2020)
    np.testing.assert_allclose(ImageFile.open(path).chromaticities, rec2020, rtol=1e-6)


def test_rgbe(tmp_path, image):
    """Shared exponents: 8 bits of the brightest channel."""
    pixels = read(scenes.write_rgbe(tmp_path / "a.hdr", image))
    assert np.all(np.abs(pixels - image) <= image.max(axis=-1, keepdims=True) / 128)
    exact = np.floor(image * 4) / 4 + 32
    exact[:, ::2] *= 2.0**20
    np.testing.assert_array_equal(read(scenes.write_rgbe(tmp_path / "b.hdr", exact)), exact)


def test_rgbe_with_run_lengths(tmp_path, image):
    path = scenes.write(tmp_path / "a.hdr", image)
    assert np.all(np.abs(read(path) - image) <= image.max(axis=-1, keepdims=True) / 128)
    file = ImageFile.open(path)  # backwards, too
    np.testing.assert_array_equal(file.read(5, 9), read(path)[5:9])
    np.testing.assert_array_equal(file.read(0, 3), read(path)[:3])


def test_rgbe_of_the_oldest_run_lengths(tmp_path):
    """A run of 300 pixels takes two marks, and goes on in the next rows."""
    image = np.random.default_rng(3).uniform(0.1, 9, (32, 64, 3))
    image[3, 10:60] = image[3, 10]
    image[20:] = image[20, 0]
    plain = scenes.write_rgbe(tmp_path / "plain.hdr", image)
    path = scenes.write_old_runs(tmp_path / "runs.hdr", image)
    assert path.stat().st_size < plain.stat().st_size - 4 * 700
    np.testing.assert_array_equal(read(path), read(plain))
    np.testing.assert_array_equal(ImageFile.open(path).read(5, 9), read(plain)[5:9])
    data = path.read_bytes()
    start = data.index(b"64\n") + 3
    for wrong in (data[:-4], data + bytes((1, 1, 1, 1)), data[:start] + b"\1\1\1\1" + data[start:]):
        path.write_bytes(wrong)
        with pytest.raises(ProbeError, match=r"runs\.hdr: damaged or truncated"):
            ImageFile.open(path).read(0, 32)


@pytest.mark.parametrize(
    "resolution",
    ["+Y {} +X {}", "-Y {} -X {}", "+X {1} -Y {0}"],
    ids=["upside down", "mirrored", "turned"],
)
def test_pictures_that_are_not_upright_are_refused(tmp_path, image, resolution):
    """OpenImageIO gives their rows as they are stored."""
    path = scenes.write_rgbe(tmp_path / "a.hdr", image, resolution.format(HEIGHT, WIDTH))
    with pytest.raises(ProbeError, match=r"a\.hdr: stored turned or mirrored .* --reorient"):
        ImageFile.open(path)


def test_orientation_of_a_photograph(tmp_path, in_unit_range):
    path = scenes.write(tmp_path / "a.jpg", in_unit_range, "uint8", Orientation=6)
    with pytest.raises(ProbeError, match="Orientation 6"):
        ImageFile.open(path, linearize=True)


@pytest.mark.parametrize("tile", [0, 16])
@pytest.mark.parametrize("planar", ["contig", "separate"])
@pytest.mark.parametrize("compression", ["none", "zip", "lzw"])
def test_float_tiff(tmp_path, image, tile, planar, compression):
    path = scenes.write(
        tmp_path / "a.tif", image, "float", tile, planarconfig=planar, compression=compression
    )
    np.testing.assert_array_equal(read(path), image)
    file = ImageFile.open(path)
    np.testing.assert_array_equal(file.read(17, 24), image[17:24])
    np.testing.assert_array_equal(file.read(3, 8), image[3:8])


@pytest.mark.parametrize("big_endian", [False, True])
def test_pfm_is_stored_upside_down(tmp_path, image, big_endian):
    path = scenes.write_pfm(tmp_path / "a.pfm", image, big_endian)
    np.testing.assert_array_equal(read(path), image)
    file = ImageFile.open(path)
    np.testing.assert_array_equal(file.read(15, 24), image[15:24])
    np.testing.assert_array_equal(file.read(0, 4), image[:4])


def test_dds_cube(tmp_path, rng):
    """OpenImageIO shows the six faces stacked, and their display window as one face."""
    faces = rng.integers(0, 256, (6, 8, 8, 3), dtype=np.uint8)
    path = scenes.write_dds_cube(tmp_path / "a.dds", faces)
    with pytest.raises(ProbeError, match="`linearize`"):
        ImageFile.open(path)
    file = ImageFile.open(path, linearize=True)
    assert (file.width, file.height, file.envmap, file.border_sampled) == (8, 48, "cube", False)
    expected = linear(faces.reshape(48, 8, 3) / 255)
    np.testing.assert_allclose(file.read(0, 48), expected, atol=1e-6)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("a.png", "uint8"),
        ("a.png", "uint16"),
        ("a.tif", "uint16"),
        ("a.tga", "uint8"),
        ("a.bmp", "uint8"),
    ],
)
def test_integers_are_srgb_or_refused(tmp_path, in_unit_range, name, kind):
    path = scenes.write(tmp_path / name, in_unit_range, kind)
    with pytest.raises(ProbeError, match=f"{name}: {kind} pixels .* `linearize`"):
        ImageFile.open(path)
    steps = 255 if kind == "uint8" else 65535
    expected = linear(np.rint(in_unit_range * steps) / steps)
    np.testing.assert_allclose(read(path, linearize=True), expected, atol=1e-6)


def test_srgb_at_known_values(tmp_path):
    """0.5 linear is 188 of 255, middle grey 18 % is 118."""
    values = np.array([0, 10, 118, 188, 255], np.uint8)
    path = scenes.write_png(tmp_path / "a.png", np.tile(values[:, None, None], (1, 2, 3)))
    expected = [0, 0.003035, 0.1812, 0.5029, 1]
    np.testing.assert_allclose(read(path, linearize=True)[:, 0, 0], expected, atol=1e-4)


def test_jpeg(tmp_path):
    smooth = np.broadcast_to(np.linspace(0, 1, 64)[:, None], (32, 64, 3))
    path = scenes.write(tmp_path / "a.jpg", smooth, "uint8", Compression="jpeg:100")
    with pytest.raises(ProbeError, match="uint8 pixels"):
        ImageFile.open(path)
    np.testing.assert_allclose(read(path, linearize=True), linear(smooth), atol=0.02)


def test_float_files_are_never_decoded_as_srgb(tmp_path, image):
    path = scenes.write(tmp_path / "a.exr", image)
    np.testing.assert_array_equal(read(path, linearize=True), image)


def test_png_with_chunks_of_others(tmp_path, rng):
    pixels = rng.integers(0, 256, (2, 4, 3), dtype=np.uint8)
    path = scenes.write_png(tmp_path / "a.png", pixels, (b"tEXt", b"Comment\0hello"))
    np.testing.assert_allclose(read(path, linearize=True), linear(pixels / 255), atol=1e-6)


def test_jpeg_with_a_trailer(tmp_path):
    path = scenes.write(tmp_path / "a.jpg", np.full((16, 32, 3), 0.5), "uint8")
    path.write_bytes(path.read_bytes() + b"made by a camera")
    np.testing.assert_allclose(read(path, linearize=True), 0.2158, atol=5e-3)


@pytest.mark.parametrize("name", ["with space.exr", "50%.exr", "a#1?x=2.exr", "Größe_日.exr"])
def test_names_of_files(tmp_path, image, name):
    np.testing.assert_array_equal(read(scenes.write(tmp_path / name, image)), image)


def test_suffix_does_not_matter_but_for_exr(tmp_path, image):
    path = scenes.write(tmp_path / "a.exr", image)
    np.testing.assert_array_equal(read(path.rename(tmp_path / "a.probe")), image)


def test_the_contents_are_the_bytes_of_the_file(tmp_path, rng):
    """Which is longer than the blocks that are read."""
    path = scenes.write(tmp_path / "a.exr", rng.random((512, 1024, 3)))
    data = path.read_bytes()
    assert len(data) > 2 * 2**20
    assert b"".join(ImageFile.open(path).contents()) == data


@pytest.mark.parametrize("kind", ["half", "float"])
def test_tall_tiles_are_decoded_once_for_all_their_rows(tmp_path, monkeypatch, image, kind):
    """They are held as they are stored, until their last row is read."""
    monkeypatch.setattr(image_file, "_BAND_PIXELS", 100)
    monkeypatch.setattr(image_file, "_BAND_ROWS", 4)
    file = ImageFile.open(scenes.write(tmp_path / "a.exr", image, kind, tile=16))
    expected = image.astype(np.float16) if kind == "half" else image
    assert file.row_multiple == 4
    for start in (*range(0, HEIGHT, 4), 8, 0, 20):
        np.testing.assert_array_equal(file.read(start, start + 4), expected[start : start + 4])
        is_held = (start + 4) % 16 and start + 4 < HEIGHT
        assert (file._held.pixels is not None) == bool(is_held)
    np.testing.assert_array_equal(file.read(13, 19), expected[13:19])


@pytest.mark.parametrize("tile", [0, 16])
def test_other_processes_and_copies_open_the_file_again(tmp_path, image, tile, monkeypatch):
    """Whatever was read before, and wherever they start."""
    monkeypatch.chdir(tmp_path)
    scenes.write(tmp_path / "a.exr", image, "float", tile)
    file = ImageFile.open("a.exr")
    file.read(0, 5)
    packed = pickle.dumps(file)
    copies = copy.deepcopy(file), copy.copy(file)
    (tmp_path / "else").mkdir()
    monkeypatch.chdir(tmp_path / "else")
    for again in (pickle.loads(packed), *copies):
        np.testing.assert_array_equal(again.read(0, HEIGHT), image)


def test_a_part_of_a_file_is_the_same_part_elsewhere(tmp_path, image):
    parts = [
        OpenEXR.Part({"type": OpenEXR.scanlineimage}, {"RGB": image * k}, name)
        for k, name in ((1, "one"), (2, "two"))
    ]
    OpenEXR.File(parts).write(str(tmp_path / "a.exr"))
    again = pickle.loads(pickle.dumps(ImageFile.open(tmp_path / "a.exr", part="two")))
    np.testing.assert_array_equal(again.read(0, HEIGHT), image * 2)


def test_files_beyond_those_that_may_be_open_are_opened_again(tmp_path, image, monkeypatch):
    """Those that are read last stay open."""
    monkeypatch.setattr(reader, "_MOST_OPEN", 2)
    files = []
    for k in range(4):
        scenes.write(tmp_path / f"{k}.exr", image * (k + 1), "float", 16)
        files.append(ImageFile.open(tmp_path / f"{k}.exr"))
    (tmp_path / "3.exr").unlink()  # it is still open
    np.testing.assert_array_equal(files[3].read(0, HEIGHT), image * 4)
    (tmp_path / "2.exr").unlink()
    for k in (0, 1, 0):
        np.testing.assert_array_equal(files[k].read(0, HEIGHT), image * (k + 1))
    with pytest.raises(ProbeError, match="no such file"):
        files[2].read(0, HEIGHT)
    scenes.write(tmp_path / "3.exr", image[:-1], "float", 0)
    with pytest.raises(ProbeError, match="not the image that it was; open it again"):
        files[3].read(0, HEIGHT)


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="the system does not list files")
def test_thousands_of_probes_may_be_opened(tmp_path, image):
    path = scenes.write(tmp_path / "a.exr", image, "float", 0)
    before = len(list(Path("/proc/self/fd").iterdir()))
    kept = [ImageFile.open(path) for _ in range(200)]
    assert len(list(Path("/proc/self/fd").iterdir())) <= before + 64
    np.testing.assert_array_equal(kept[0].read(0, HEIGHT), image)


def test_a_file_that_is_gone_is_not_handed_to_other_processes(tmp_path, image):
    path = scenes.write(tmp_path / "a.exr", image, "float", 0)
    file = ImageFile.open(path)
    packed = pickle.dumps(file)
    path.unlink()
    with pytest.raises(ProbeError, match="gone, so that no other process can open it"):
        pickle.dumps(file)
    with pytest.raises(ProbeError, match="no such file"):
        pickle.loads(packed)
