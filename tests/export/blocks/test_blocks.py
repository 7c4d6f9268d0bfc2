"""Blocks of texels as decoders read them: BC6H by OpenImageIO, ASTC by Arm; what they lose."""

import re
import struct

import numpy as np
import pytest

from shrm_cli.errors import ArgumentError
from shrm_cli.export.blocks import astc, bc6h, rate, uastc, uastc_bits
from shrm_cli.export.blocks.bc6h import ANCHORS, MODES, PARTITIONS, pack
from shrm_cli.export.blocks.lines import Found, Texels, line, nearest, refined, with_lamps
from shrm_cli.export.cubes import decoded
from shrm_cli.export.dds import dds_cube, dds_image
from shrm_cli.export.engine import Light, engine
from shrm_cli.export.ktx import ktx2
from shrm_cli.export.packing import BLOCKS, packed
from shrm_cli.export.pixels import FORMATS, encoded, loss
from shrm_cli.files.openimageio import image_of

WEIGHTS = {8: [0, 9, 18, 27, 37, 46, 55, 64],
           16: [0, 4, 9, 13, 17, 21, 26, 30, 34, 38, 43, 47, 51, 55, 60, 64]}  # fmt: skip


def needs(name):
    if name.startswith("astc"):
        pytest.importorskip("astc_encoder", reason="the extra astc is not installed")


def smooth(size):
    """Return six faces whose light grows by a factor of 100 along each, in three hues."""
    ramp = np.exp(np.linspace(0, 4.6, size))
    faces = np.stack([ramp[None, :, None] * np.exp(0.3 * ramp[:, None, None] / 100)] * 6)
    return faces * np.array([1.0, 0.6, 0.2])


@pytest.mark.parametrize("mode", MODES, ids=lambda mode: f"mode {mode.code}")
def test_random_blocks_read_as_their_numbers_say(rng, mode):
    """Every field of every mode, against the interpolation of the specification."""
    count, most = 4000, 16 if mode.lines == 1 else 8
    written = rng.integers(0, 1 << mode.bits, (2 * mode.lines, 3, count))
    if not mode.is_whole:
        half = np.array([1 << bits - 1 for bits in mode.differences])[:, None]
        written[1:] = written[0] + rng.integers(-half, half, written[1:].shape)
        written = written[..., ((written >= 0) & (written < 1 << mode.bits)).all(axis=(0, 1))]
    count = written.shape[-1]
    assert count > 500
    ends = written if mode.is_whole else np.concatenate([written[:1], written[1:] - written[0]])
    partition = rng.integers(0, 32, count) * (mode.lines == 2)
    indices = rng.integers(0, most, (16, count))
    indices[0] %= most // 2
    if mode.lines == 2:
        indices[ANCHORS[partition], np.arange(count)] %= most // 2
    data = pack(mode, ends, indices, partition).tobytes()
    found = image_of(dds_image(data, 4 * count, 4), ".dds").reshape(count, 16, 3)
    whole = ((written << 16) + 0x8000) >> mode.bits
    whole = np.where(written == (1 << mode.bits) - 1, 0xFFFF, np.where(written == 0, 0, whole))
    whole = written if mode.bits == 16 else whole
    for block in rng.integers(0, count, 200).tolist():
        for texel in range(16):
            line = int(mode.lines == 2 and PARTITIONS[partition[block], texel])
            weight = WEIGHTS[most][indices[texel, block]]
            for channel in range(3):
                first, last = whole[2 * line : 2 * line + 2, channel, block].tolist()
                bits = ((first * (64 - weight) + last * weight + 32) >> 6) * 31 >> 6
                (value,) = struct.unpack("<e", struct.pack("<H", bits))
                assert found[block, texel, channel] == value


def random_uastc(rng):
    """Return random ends of every way to write them, and where texels lie between them."""
    there = np.unique(uastc_bits.NEAR[8])
    numbers = there[rng.integers(0, len(there), (6, 40000))]
    numbers = numbers[:, (uastc_bits.read(numbers) <= 3967).all(axis=(0, 1))]
    assert numbers.shape[1] > 10000
    return numbers, rng.integers(0, 16, (16, numbers.shape[1]))


def test_arm_reads_the_blocks_of_uastc(rng):
    """All ways to write ends: what Arm's decoder makes of the bits, to the last bit."""
    pytest.importorskip("astc_encoder", reason="the extra astc is not installed")
    numbers, indices = random_uastc(rng)
    data = uastc_bits.pack(numbers, indices)
    found = astc.decode(data.tobytes(), 4 * len(data), 4, 4).reshape(-1, 16, 3)
    first, last = (16 * uastc_bits.read(numbers)).transpose(0, 2, 1)[:, :, None]
    weight = np.array([0, 4, 8, 12, 17, 21, 25, 29, 35, 39, 43, 47, 52, 56, 60, 64])[indices.T]
    numbers = (first * (64 - weight[..., None]) + last * weight[..., None] + 32) >> 6
    low = numbers & 2047
    mantissa = np.select([low < 512, low < 1536], [3 * low, 4 * low - 512], 5 * low - 2048) >> 3
    light = np.where(
        numbers >> 11 == 0,
        np.ldexp(mantissa, -24),
        np.ldexp(1024.0 + mantissa, (numbers >> 11) - 25),
    )
    assert (found == light).all()


def test_the_fields_of_uastc_are_read_again(rng):
    numbers, indices = random_uastc(rng)
    found = uastc_bits.unpack(uastc_bits.pack(numbers, indices))
    assert (found[0] == numbers).all()
    assert (found[1] == indices).all()


@pytest.mark.parametrize("octaves", [0.05, 0.5, 2, 5, 9])
def test_ends_of_uastc_lie_within_their_steps(rng, octaves):
    """The further apart the ends, the coarser: by Binomial's bits, which leave a third more."""
    ends = rng.uniform(9 * 2048, 20 * 2048, (1, 3, 5000)).repeat(2, axis=0)
    ends[0] -= rng.uniform(0, octaves * 2048, ends[0].shape)
    found = 16 * uastc_bits.read(uastc_bits.written(ends, np.ones((3, 5000))))
    off = np.sqrt(((found - ends) ** 2).mean(axis=(0, 1)))
    assert off.max() < 512
    assert np.median(off) < 512 / 3


def test_uastc_as_bc6h_is_the_same_light_almost(rng):
    """OpenImageIO and Arm's decoder; BC6H interpolates 1 + f where ASTC has nearly 2^f, at most
    6.2 % less, and its ends are coarser."""
    pytest.importorskip("astc_encoder", reason="the extra astc is not installed")
    faces = smooth(48)
    data, _ = encoded(faces, BLOCKS["uastc"], "")
    pictures = [decoded(data, BLOCKS[name], 6, 48) for name in ("uastc", "astc4x4")]
    assert 0 < np.abs(pictures[0] / pictures[1] - 1).max() < 0.08
    assert np.median(np.abs(pictures[0] / pictures[1] - 1)) < 0.01


@pytest.mark.parametrize("name", BLOCKS)
def test_smooth_light_is_kept(name):
    needs(name)
    faces = smooth(48)
    data, _ = encoded(faces, BLOCKS[name], "")
    edge = BLOCKS[name].edge
    assert len(data) == 6 * 16 * (48 // edge) ** 2
    found = loss("", faces, decoded(data, BLOCKS[name], 6, 48))
    assert found.p95 < 0.03
    assert found.rms < 0.02


@pytest.mark.parametrize("name", BLOCKS)
def test_faces_and_rows_keep_their_places(name):
    needs(name)
    faces = np.arange(1.0, 1 + 6 * 24 * 24).reshape(6, 24, 24)[..., None] * [1.0, 1.0, 1.0]
    found = decoded(encoded(faces, BLOCKS[name], "")[0], BLOCKS[name], 6, 24)
    assert np.abs(found / faces - 1).max(where=faces > 24 * 24, initial=0) < 0.03


@pytest.mark.parametrize(("name", "octaves", "most"), [("bc6h", 27.9, 1.5e-3), ("uastc", 1, 0.01)])
def test_a_constant_is_kept_to_the_last_bits(rng, name, octaves, most):
    """Channels of UASTC that are further apart are coarser."""
    exponents = rng.uniform(-12, 15.9 - octaves, (6, 1, 1, 1))
    colors = np.exp2(exponents + rng.uniform(0, octaves, (6, 1, 1, 3)))
    faces = np.broadcast_to(colors, (6, 8, 8, 3))
    found = decoded(encoded(faces, BLOCKS[name], "")[0], BLOCKS[name], 6, 8)
    assert np.abs(found / faces - 1).max() < most


@pytest.mark.parametrize("name", ["bc6h", "uastc"])
def test_a_lamp_keeps_its_energy(rng, name):
    """A disc of a few texels, 10 000 times as bright as the noise around it."""
    faces = np.exp(rng.normal(0, 0.3, (6, 64, 64, 3)))
    distance = np.hypot(*np.meshgrid(np.arange(64) - 30.3, np.arange(64) - 33.6))
    faces[2] += 1e4 * np.clip(2.8 - distance, 0, 1)[..., None] * [1, 0.8, 0.5]
    found = loss("", faces, decoded(encoded(faces, BLOCKS[name], "")[0], BLOCKS[name], 6, 64))
    assert 0 < found.lamp < 0.02


@pytest.mark.parametrize("name", ["bc6h", "uastc"])
def test_the_blocks_of_lamps_are_searched_for_longer(rng, name):
    """Lamps that fall off by a thousand: their texels are nearer than without the search."""
    faces = np.exp(rng.normal(0, 0.3, (6, 16, 16, 3)))
    for face, middle in zip(faces, rng.uniform(4, 12, (6, 2)), strict=True):
        distance = np.hypot(*np.meshgrid(np.arange(16) - middle[0], np.arange(16) - middle[1]))
        face += 2e4 * np.exp(-((distance / 1.3) ** 2))[..., None] * [1, 0.8, 0.5]
    coder = {"bc6h": bc6h, "uastc": uastc}[name]
    blocks = faces.reshape(24, 4, 4, 4, 3).transpose(4, 1, 3, 0, 2).reshape(3, 16, -1)
    plain = coder.encoded(blocks, np.zeros(96, np.float32))
    off = [
        loss("", faces, decoded(data.tobytes(), BLOCKS[name], 6, 16)).rms
        for data in (plain.data, BLOCKS[name].pack(faces))
    ]
    assert off[1] < 0.9 * off[0]


@pytest.mark.parametrize("name", ["bc6h", "uastc"])
def test_dim_even_light_has_no_lamps(monkeypatch, name):
    """Its blocks are all in error by the steps of the format, which no search makes smaller."""
    coder, counts = {"bc6h": bc6h, "uastc": uastc}[name], []

    def searched(blocks):
        counts.append(blocks.shape[-1])
        return coder.encoded(blocks, np.zeros(counts[-1], np.float32))

    monkeypatch.setattr(coder, "searched", searched)
    for size in (256, 128, 64):
        BLOCKS[name].pack(np.full((6, size, size, 3), 1.03e-6))
    assert counts == []


@pytest.mark.parametrize("name", ["bc6h", "uastc"])
def test_light_is_too_dim_where_the_ends_of_blocks_are_coarse(rng, name):
    """Ends of UASTC HDR have 12 bits: of light of 1e-6 it lost 10 to 30 %, without a word."""
    blocks = np.exp(rng.uniform(0, 0.4, (6, 8, 8, 3))).repeat(4, axis=1).repeat(4, axis=2)
    for factor, least, most in ((1, 0.02, 0.05), (0.4, 0.05, 1), (4, 0, 0.02)):
        faces = blocks / blocks.mean() * factor * BLOCKS[name].dimmest
        found = loss("", faces, decoded(encoded(faces, BLOCKS[name], "")[0], BLOCKS[name], 6, 32))
        assert least < found.rms < most


def test_many_blocks_are_searched_for_in_turn(rng):
    """A search takes memory for each block of it, so that it never gets many of them."""
    blocks = np.exp(rng.normal(0, 1, (3, 16, 900)))
    found = Found(np.zeros((900, 16), np.uint8), np.ones(900), np.full(900, np.inf))
    counts = []

    def search(some):
        counts.append(some.shape[-1])
        marks = (100 * some[0, :16].T).astype(np.uint8)
        return Found(marks, np.zeros(len(marks)), np.zeros(len(marks)))

    data = with_lamps(blocks, found, search)
    lamps = (blocks**2).sum(axis=(0, 1)) > 1e-3 * (blocks**2).sum()
    assert sum(counts) == lamps.sum() > 300
    assert max(counts) <= 256
    np.testing.assert_array_equal(data[lamps], (100 * blocks[0].T[lamps]).astype(np.uint8))
    assert not data[~lamps].any()


def test_a_lamp_is_searched_for_wherever_it_has_a_thousandth_of_the_light():
    """Or four times the mean of all blocks, which is less in large levels."""
    for count, least in ((100, 1e-3), (10000, 4e-4)):
        for share, is_lamp in ((1.1 * least, True), (0.9 * least, False)):
            blocks = np.full((3, 16, count), 1e-3)
            blocks[..., 1] = 1
            blocks[..., 0] = np.sqrt(share / (1 - share) * (blocks[..., 1:] ** 2).sum() / 48)
            found = Found(np.zeros((count, 16), np.uint8), np.ones(count), np.zeros(count))
            found.off[0] = np.inf

            def search(some):
                ones = np.ones(some.shape[-1])
                return Found(np.ones((len(ones), 16), np.uint8), ones, ones)

            assert with_lamps(blocks, found, search)[0].all() == is_lamp


def light_of(size, rng, noise):
    """A level of a real probe, about: slopes in all directions, and noise upon them."""
    at = np.linspace(0, 6, size)
    waves = np.sin(at[:, None] + rng.uniform(0, 6, (6, 1, 1))) * np.sin(2 * at)
    hue = np.array([1.0, 0.8, 0.6]) ** (1 + waves[..., None])
    return np.exp(waves)[..., None] * hue * np.exp(rng.normal(0, noise, (6, size, size, 3)))


@pytest.mark.parametrize(("name", "saved"), [("uastc", 0.15), ("bc6h", 0.05)])
def test_cheap_bits_make_files_smaller_and_errors_hardly_larger(rng, monkeypatch, name, saved):
    """Zstandard itself counts, and other decoders read; beside the nearest steps and ends."""
    zstandard = pytest.importorskip("zstandard")
    faces = light_of(128, rng, 0.01)
    found = []
    for price in (0.0, rate.PRICE):
        monkeypatch.setattr(rate, "PRICE", price)
        data, _ = encoded(faces, BLOCKS[name], "")
        lost = loss("", faces, decoded(data, BLOCKS[name], 6, 128))
        found.append((len(zstandard.ZstdCompressor(level=18).compress(data)), lost))
    (whole, exact), (packed_bytes, cheap) = found
    assert packed_bytes < (1 - saved) * whole
    assert exact.rms < cheap.rms < 1.15 * exact.rms
    assert cheap.p95 < 1.2 * exact.p95


def test_bits_of_light_that_is_noise_are_dearer(rng):
    """Noise packs badly: an ideal code may take 6.4 bits a byte of it, 12.8 bytes a block."""
    zstandard = pytest.importorskip("zstandard")
    faces = light_of(128, rng, 0.2)
    data, _ = encoded(faces, BLOCKS["uastc"], "")
    blocks = faces.reshape(192, 4, 32, 4, 3).transpose(4, 1, 3, 0, 2).reshape(3, 16, -1)
    plain = uastc.encoded(blocks, np.zeros(len(blocks[0, 0]), np.float32)).data.tobytes()
    pack = zstandard.ZstdCompressor(level=18).compress
    assert len(pack(plain)) > 0.85 * len(data)
    assert len(pack(data)) < 6.4 / 8 * len(data)
    lost = [loss("", faces, decoded(each, BLOCKS["uastc"], 6, 128)) for each in (plain, data)]
    assert lost[0].rms < lost[1].rms < 1.5 * lost[0].rms


def test_bright_and_smooth_light_keeps_more_than_the_rest(rng):
    blocks = np.exp(rng.normal(0, 0.1, (1, 16, 4096))) * np.ones((3, 1, 1))
    blocks[..., :64] *= 100
    blocks[..., 64:128] = 1 + 0.05 * (blocks[..., 64:128] - 1)
    prices = rate.starting_prices(blocks)
    assert prices[:64].max() < prices[128:].min() / 50
    assert prices[64:128].max() < prices[128:].min() / 5
    assert (rate.starting_prices(blocks[..., :1024]) == 0).all()


def test_uastc_suits_both_of_its_decoders(rng):
    """ASTC and BC6H differ by up to 6 % within an octave. With lines and steps that suit ASTC alone
    BC6H had 1.35 %, 1.8 times its error."""
    pytest.importorskip("astc_encoder", reason="the extra astc is not installed")
    faces = light_of(64, rng, 0.0)
    data, _ = encoded(faces, BLOCKS["uastc"], "")
    lost = [
        loss("", faces, decoded(data, BLOCKS[name], 6, 64)).rms for name in ("uastc", "astc4x4")
    ]
    assert max(lost) < 1.4 * min(lost)
    assert max(lost) < 0.012


@pytest.mark.parametrize("count", [16, 256])
def test_the_smallest_of_errors_is_found(rng, count):
    errors = rng.uniform(0, 1, (count, 50, 40)).astype(np.float32)
    found = np.take_along_axis(errors, rate.smallest(errors)[None], axis=0)[0]
    assert (found <= errors.min(axis=0) * (1 + 2.0**-14)).all()


@pytest.mark.parametrize("lines", [1, 2])
def test_refined_ends_are_nearer_to_the_light(rng, lines):
    """Gauss and Newton's steps against what any other ends near them reach."""
    light = np.exp(rng.uniform(0, 8, (3, 16, 200)))
    texels = Texels.of(light, bc6h.SPACE)
    members = np.arange(16)[:, None] < 16 // lines + 0 * np.arange(200)

    def left(ends):
        at = nearest(texels, ends, 8) / np.float32(7)
        found = bc6h.SPACE.light(ends[0][:, None] + at * (ends[1] - ends[0])[:, None])
        return (((found - texels.light) ** 2).sum(axis=0) * members).sum(axis=0)

    start = line(texels, members, 8)
    ends = refined(texels, members, start, 8, 0.0)
    assert np.median(left(ends) / left(start)) < 0.8
    others = [left(ends + rng.normal(0, 300, ends.shape).astype(np.float32)) for _ in range(20)]
    assert np.mean(left(ends) <= np.median(others, axis=0)) > 0.9


def test_black_and_the_brightest_light_are_blocks_as_well():
    faces = np.zeros((6, 8, 8, 3))
    faces[1, 2, 3] = bc6h.LARGEST
    found = decoded(encoded(faces, BLOCKS["bc6h"], "")[0], BLOCKS["bc6h"], 6, 8)
    assert np.abs(found[1, 2, 3] / bc6h.LARGEST - 1).max() < 0.02
    assert (found[0] == 0).all()
    assert np.delete(found[1].reshape(64, 3), 19, axis=0).max() < 1e-3


@pytest.mark.parametrize("name", FORMATS)
def test_plain_texels_are_read_again(rng, name):
    faces = np.exp(rng.normal(0, 2, (6, 8, 8, 3)))
    found = decoded(encoded(faces, FORMATS[name], "")[0], FORMATS[name], 6, 8)
    step = {"rgba16f": 2**-11, "r11g11b10": 2**-6, "rgb9e5": 2**-9}[name]
    off = np.abs(found - faces) / faces.max(axis=-1, keepdims=True)
    assert step / 4 < off.max() <= step


@pytest.mark.parametrize("compress", [False, True])
@pytest.mark.parametrize("name", BLOCKS)
def test_ktx2_tells_of_blocks(name, compress):
    """Numbers of Vulkan and of the Khronos Data Format Specification 1.3, tables 20 and 23."""
    size, number, model, lower = {
        "bc6h": (4, 143, 133, 0), "uastc": (4, 1000066000, 167, 0),
        "astc4x4": (4, 1000066000, 162, 0xBF800000),
        "astc6x6": (6, 1000066004, 162, 0xBF800000),
    }[name]  # fmt: skip
    levels = [bytes([k + 1]) * (6 * 16 * -((-edge // size) ** 2)) for k, edge in enumerate((16, 8))]
    data = ktx2(levels, (16, 16, 0), BLOCKS[name], compress, 6)
    assert struct.unpack_from("<2I", data, 12) == (number, 1)
    at, length = struct.unpack_from("<2I", data, 48)
    assert struct.unpack_from("<IIHH", data, at) == (length, 0, 2, 40)
    assert data[at + 12] == model
    assert data[at + 16 : at + 28] == bytes([size - 1, size - 1, 0, 0, 16, *[0] * 7])
    channel = 0x80 if name in ("bc6h", "uastc") else 0xC0
    sample = struct.unpack_from("<HBBIII", data, at + 28)
    assert sample == (0, 127, channel, 0, lower, 0x3F800000)
    for k, level in enumerate(levels):
        offset, stored, whole = struct.unpack_from("<3Q", data, 80 + 24 * k)
        assert whole == len(level)
        if not compress:
            assert offset % 16 == 0
            assert data[offset : offset + stored] == level


def test_openimageio_reads_the_cube_of_a_dds(tmp_path):
    oiio = pytest.importorskip("OpenImageIO")
    faces = smooth(32)
    levels = [encoded(faces[:, ::step, ::step], BLOCKS["bc6h"], "")[0] for step in (1, 2)]
    path = tmp_path / "a.dds"
    path.write_bytes(dds_cube(levels, 32, BLOCKS["bc6h"]))
    image = oiio.ImageInput.open(str(path))
    assert image.spec().get_string_attribute("compression") == "BC6HU"
    flags, height, width, pitch = struct.unpack_from("<4I", path.read_bytes(), 8)
    assert (height, width, pitch) == (32, 32, 16 * 64)
    assert flags & 0x80008 == 0x80000
    found = image.read_image(0, 0, 0, 3, oiio.FLOAT).reshape(-1, 3)
    # All faces lie in one picture, with black between them.
    near = faces.reshape(-1, 3)
    bright = np.sort(found[:, 0])[-len(near) :]
    assert np.isclose(bright, np.sort(near[:, 0]), rtol=0.05).all()


def test_what_changes_light_too_much_is_refused_or_passed_over(rng):
    """Noise, of which BC6H loses much and RGB9E5 little."""
    noise = np.exp(rng.normal(0, 1, (6 * 8, 8, 3)))
    bevy, light = engine("bevy"), Light("a", "a.exr", levels=(noise,), roughness=(0.0,))
    wanted = (
        r"0\.02 is not kept: bc6h changes level 0 by .*; ([0-9.]+) is, or give `format` rgba16f"
    )
    with pytest.raises(ArgumentError, match=wanted) as refused:
        packed(bevy, light, "bc6h", 0.02)
    least = float(re.search(wanted, str(refused.value))[1])
    assert packed(bevy, light, "bc6h", least).losses  # what is told is kept
    chosen = packed(bevy, light, "auto", 0.02)
    (line,) = [line for line in chosen.told if line.startswith("bc6h changes level 0 by")]
    assert line.endswith("; rgb9e5 was written instead")
    (found,) = chosen.losses
    assert 1e-4 < found.worst < 0.01
    lenient = packed(bevy, light, "auto", 10.0)
    assert lenient.losses[0].rms > 0.05


def test_of_several_levels_that_lose_lamps_the_worst_is_told(rng):
    """Noise of 8 x 8 bright texels, which is stronger in the second of three levels."""
    levels = []
    for size, spread in ((64, 0.9), (32, 1.3), (16, 0.9)):
        level = np.full((6 * size, size, 3), 0.01)
        level[4:12, 4:12] = np.exp(rng.normal(0, spread, (8, 8, 3)))
        levels.append(level)
    light = Light("a", "a.exr", levels=tuple(levels), roughness=(0.0, 0.5, 1.0))
    lost = [each.lamp for each in packed(engine("three"), light, "uastc", None).losses]
    assert lost[1] == max(lost)
    count = sum(each > 0.02 for each in lost) - 1
    (line,) = [
        each for each in packed(engine("three"), light, None, None).told if "instead" in each
    ]
    assert line.startswith("uastc changes level 1 by")
    assert count > 0
    more = f"{count} more level{'s' * (count > 1)}"
    assert line.endswith(f", and {more} too much; rgba16f was written instead")


@pytest.mark.parametrize("spread", [0.1, 1.0])
def test_lamps_that_the_default_would_change_get_texels_that_do_not(rng, spread):
    """A lamp that is smooth, and one of noise, whose brightest texels stand beside dark ones."""
    level = np.full((6 * 64, 64, 3), 0.01)
    level[16:24, 16:24] = np.exp(rng.normal(0, spread, (8, 8, 3)))
    three, light = engine("three"), Light("a", "a.exr", levels=(level,), roughness=(0.0,))
    chosen = packed(three, light, None, None)
    (found,) = chosen.losses
    assert found.lamp < 0.02
    is_spare = spread == 1
    names = {file.name for file in chosen.files}
    assert ("shrm-environment.js" in names) == is_spare
    lines = [line for line in chosen.told if line.startswith("uastc changes level 0 by")]
    assert [line[-29:] for line in lines] == ["; rgba16f was written instead"] * is_spare
    (lost,) = packed(three, light, "uastc", None).losses
    assert (lost.lamp > 0.02) == is_spare
    with pytest.raises(ArgumentError, match="rgba16f changes level 0 by"):
        packed(three, light, None, 1e-6)


def test_spare_texels_are_taken_where_they_keep_what_the_default_loses(rng):
    """A lamp beyond half precision is lost by both; a lamp of noise in another level by one."""
    level = np.full((6 * 64, 64, 3), 0.01)
    level[20, 20] = 1e6
    noise = np.full((6 * 32, 32, 3), 0.01)
    noise[8:16, 8:16] = np.exp(rng.normal(0, 1, (8, 8, 3)))
    for levels, is_spare in (((level,), False), ((level, noise), True)):
        light = Light("a", "a.exr", levels=levels, roughness=(0.0, 0.5)[: len(levels)])
        chosen = packed(engine("three"), light, None, None)
        assert chosen.losses[0].lamp > 0.9
        names = {file.name for file in chosen.files}
        assert ("shrm-environment.js" in names) == is_spare
        assert any(line.startswith("uastc changes level 1 by") for line in chosen.told) == is_spare
        assert any("instead" in line for line in chosen.told) == is_spare


def diffuse_levels(hue):
    """Two levels whose colours change in both directions of a face, by so much, as E / pi does."""
    levels = []
    for size in (16, 8):
        at = np.linspace(-1, 1, size)
        red, green = np.meshgrid(np.exp(hue * at), np.exp(hue * at))
        levels.append(np.tile(np.stack([red, green, 1 / red], axis=-1), (6, 1, 1)))
    return Light("a", "a.exr", levels=tuple(levels), roughness=(0.0, 1.0))


@pytest.mark.parametrize(
    ("hue", "low", "high"), [(0.1, 0.0, 0.05), (0.25, 0.05, 0.1), (0.6, 0.1, 1.0)]
)
def test_diffuse_light_in_squares_is_told(hue, low, high):
    """Of three.js the last level lights diffuse surfaces: of a courtyard a 95th percentile of 12 %
    was seen as squares, and nothing told of it."""
    three, light = engine("three"), diffuse_levels(hue)
    asked = packed(three, light, "uastc", None)
    assert low < asked.losses[-1].p95 < high
    lines = [line for line in asked.told if "squares" in line]
    assert [line[-16:] for line in lines] == ["rgba16f has none"] * (low > 0)
    chosen, is_spare = packed(three, light, None, None), low == 0.1
    assert ("shrm-environment.js" in {file.name for file in chosen.files}) == is_spare
    told = [line for line in chosen.told if line.startswith("uastc changes level 1 by")]
    assert ["instead" in line for line in told] == [is_spare] * (low > 0)
    assert (chosen.losses[-1].p95 < 0.05) == (is_spare or low == 0)


def test_other_engines_have_finer_cubes_for_diffuse_light():
    """And a rough level, of which a part of the light is, stays as it was."""
    made = packed(engine("bevy"), diffuse_levels(1.5), "bc6h", None)
    assert made.losses[1].p95 > 0.05
    assert not any("squares" in line for line in made.told)
