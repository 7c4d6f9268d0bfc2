"""Ways to damage a file: at random, and knowing what its fields mean."""

import io
import random
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Sequence

from tests.fuzz.exr_header import Attribute, Headers, parse

Mutation = Callable[[bytes, random.Random], bytes]

_INTEGERS = (0, 1, -1, 2, 7, 127, 128, 255, 256, 32767, 65535, 65536, 2**24, 2**31 - 1, -(2**31))
_FLOATS = (0.0, -0.0, 1.0, -1.0, 1e-45, 3e38, -3e38, float("inf"), float("-inf"), float("nan"))
_NUMBERS = ("nan", "inf", "-inf", "1e999", "-1", "0", "1e-320", "9" * 400, "0x10", "", "\uff11")
_TEXTS = (
    b"",
    b"\x1b]0;pwned\x07",
    b"\x9b31m\xc2\x9b31m",
    "\u202e\u2066evil\u200b\ufeff".encode(),
    b"\xff\xfe\x80",
    b"a\nError: b\r\nc",
    b"%s%n{0}" * 9,
    b"x" * 70_000,
    b"NaN",
    b'{"name": "\\ud800", "parameters": {}}',
    b'{"name": "ggx", "parameters": {"roughness": NaN}}',
    b'{"name": "ggx", "parameters": {"roughness": 1e999}}',
    b'{"name": "sum", "parameters": {"spec": "' + b"1*ggx+" * 500 + b'ggx"}}',
    b'{"name": "/etc/passwd", "parameters": {}}',
    b'{"name": "\\u001b]0;x\\u0007", "parameters": {"\\u202e": "\\u009b"}}',
    b'{"a":' * 990 + b"1" + b"}" * 990,
    b"[" * 100_000,
    b'{"shape":[2,3],"values":[1e999,NaN,1,true,"x",null]}',
    b"[[1e999, true, null], [1]]",
    b"9" * 5000,
)
_ODD = (
    b"..", b"/", b"/dev/null", b"/dev/stdin", b"-", b"--", b"~", b"a/b/c", b"%", b"a_%.exr", b"*",
    b"sound.exr", b"sound.exr/", b"./sound.exr", b"ggx+", b"+", b"*ggx", b"1e5*ggx+1e-5*phong",
    b"ggx:roughness=0.5:roughness=1", b"0.5,", b",", b"1e400,0", b"inf..nan", b"0/0/0", b"pca:0",
)  # fmt: skip
_KINDS = (
    b"int", b"float", b"string", b"double", b"box2i", b"chlist", b"chromaticities", b"v2f", b"m44f",
    b"preview", b"stringvector", b"timecode", b"keycode", b"rational", b"tiledesc", b"envmap",
    b"compression", b"floatvector", b"opaque", b"bytes",
)  # fmt: skip
_NAMES = (
    b"Orientation", b"chromaticities", b"envmap", b"textureformat", b"shrm:representation",
    b"shrm:brdf", b"shrm:table", b"shrm:brdf_table", b"shrm:window", b"name", b"type", b"view",
    b"multiView", b"chunkCount", b"preview", b"pixelAspectRatio", b"worldToCamera", b"tiles",
    b"\x1b[31m", b"oiio:ColorSpace", b"version", b"maxSamplesPerPixel", b"deepImageState",
)  # fmt: skip
_PNG_COLORS = (b"cICP", b"iCCP", b"sRGB", b"cHRM", b"gAMA")


def damage(data: bytes, others: Sequence[bytes], rng: random.Random) -> bytes:
    """Damage a file in a random way.

    Parameters
    ----------
    data : bytes
        A sound file.
    others : sequence of bytes
        Other sound files, parts of which may be put into it.
    rng : random.Random
        Decides on everything.
    """
    ways: list[Mutation] = [*_PLAIN, lambda found, rng: _spliced(found, rng.choice(others), rng)]
    aware = _aware(data)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        way = rng.choice(aware) if aware and rng.random() < 0.6 else rng.choice(ways)
        data = way(data, rng)
    return data


def word(rng: random.Random) -> str:
    """Return an argument as no user gives it; bytes that are no text stand as Python has them."""
    text = rng.choice((*_TEXTS, *(each.encode() for each in _NUMBERS), *_ODD)).replace(b"\0", b"")
    if rng.random() < 0.3:
        text = _bits(text, rng).replace(b"\0", b"")
    return text.decode("utf-8", "surrogateescape")


def _aware(data: bytes) -> list[Mutation]:
    """The ways that know the fields of such a file."""
    if parse(data) is not None:
        return [_exr_attribute, _exr_attribute, _exr_attribute, _exr_pixels]
    if data.startswith(b"\x89PNG"):
        return [_png_sums]
    if data.startswith(b"PK\x03\x04"):
        return [_zip_member]
    if b"\0" not in data[:512]:
        return [_text_number, _text_line, _text_string]
    return [_integer]


# ---- at random -----------------------------------------------------------------------------------


def _bits(data: bytes, rng: random.Random) -> bytes:
    changed = bytearray(data or b"\0")
    for _ in range(rng.choice((1, 1, 2, 8, 32))):
        changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def _head_bits(data: bytes, rng: random.Random) -> bytes:
    """Flip bits where most formats keep what matters."""
    cut = min(len(data), rng.choice((16, 64, 400)))
    return _bits(data[:cut], rng) + data[cut:]


def _truncated(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.choice((rng.randrange(len(data) + 1), max(len(data) - rng.randrange(9), 0)))]


def _grown(data: bytes, rng: random.Random) -> bytes:
    return data + rng.randbytes(rng.choice((1, 8, 1000)))


def _integer(data: bytes, rng: random.Random) -> bytes:
    """Put a number of any width somewhere: often a count or a length."""
    layout = rng.choice(("<i", ">i", "<h", ">h", "<q", "b"))
    width = struct.calcsize(layout)
    at = rng.randrange(max(min(len(data), rng.choice((64, 1000, 10**9))) - width, 1))
    wrapped = rng.choice(_INTEGERS) % 2 ** (8 * width)
    return data[:at] + wrapped.to_bytes(width, "little") + data[at + width :]


def _moved_block(data: bytes, rng: random.Random) -> bytes:
    """Delete a block, or put it elsewhere once more."""
    start = rng.randrange(len(data) + 1)
    block = data[start : start + rng.choice((1, 4, 50, 1000))]
    if rng.random() < 0.5:
        return data[:start] + data[start + len(block) :]
    at = rng.randrange(len(data) + 1)
    return data[:at] + block + data[at:]


def _zeroed(data: bytes, rng: random.Random) -> bytes:
    start, count = rng.randrange(len(data) + 1), rng.choice((1, 4, 64))
    return data[:start] + bytes([rng.choice((0, 255, 27))]) * count + data[start + count :]


def _spliced(data: bytes, other: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data) + 1)] + other[rng.randrange(len(other) + 1) :]


_PLAIN: list[Mutation] = [_bits, _head_bits, _truncated, _grown, _integer, _moved_block, _zeroed]


# ---- OpenEXR -------------------------------------------------------------------------------------


def _exr_attribute(data: bytes, rng: random.Random) -> bytes:
    """Edit, rename, retype, drop, double or add an attribute, or lie about its length."""
    found = parse(data)
    if found is None:
        return _bits(data, rng)
    part = rng.choice(found.parts)
    if not part:
        return _bits(data, rng)
    index = rng.randrange(len(part))
    chosen = part[index]
    deed = rng.randrange(10)
    if deed <= 4:
        chosen.data = _value(chosen, rng)
    elif deed == 5:
        chosen.kind = rng.choice(_KINDS)
    elif deed == 6:
        chosen.name = rng.choice((*_NAMES, *_TEXTS[1:6]))
    elif deed == 7:
        part.insert(index, Attribute(rng.choice(_NAMES), rng.choice(_KINDS), rng.choice(_TEXTS)))
    elif deed == 8:
        chosen.size = rng.choice((*_INTEGERS, len(chosen.data) + 1))
    else:
        _dropped_or_doubled(found, part, index, rng)
    return found.packed()


def _dropped_or_doubled(
    found: Headers, part: list[Attribute], index: int, rng: random.Random
) -> None:
    if rng.random() < 0.5:
        del part[index]
    elif rng.random() < 0.8:
        part.insert(index, part[index])
    elif rng.random() < 0.5:
        found.parts.append(rng.choice(found.parts))
    else:
        count = rng.choice((300, 3000, 100_000))
        part += [Attribute(b"a%d" % k, b"int", b"\0\0\0\0") for k in range(count)]


def _value(attribute: Attribute, rng: random.Random) -> bytes:
    """Another value of the type that an attribute has."""
    kind, data = attribute.kind, attribute.data
    if kind == b"string":
        return rng.choice((*_TEXTS, _text_number(data, rng), _bits(data, rng)))
    if kind == b"chlist":
        return _channels(data, rng)
    if kind in (b"compression", b"lineOrder", b"envmap"):
        return bytes([rng.choice((0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 255))])
    if len(data) % 4 or not data:
        return _bits(data, rng)
    at = rng.randrange(len(data) // 4) * 4
    is_float = kind in (b"float", b"chromaticities", b"v2f", b"v3f", b"m44f")
    value = (
        struct.pack("<f", rng.choice(_FLOATS))
        if is_float
        else struct.pack("<i", rng.choice(_INTEGERS))
    )
    return data[:at] + value + data[at + 4 :]


def _channels(data: bytes, rng: random.Random) -> bytes:
    """Rename channels, change their types and samplings, or make many of them."""
    if rng.random() < 0.2:
        count = rng.choice((50, 3000, 60_000))
        each = struct.pack("<iB3xii", rng.randrange(4), 0, 1, 1)
        return b"".join(b"c%05d\0" % k + each for k in range(count)) + b"\0"
    if rng.random() < 0.5:
        names = list(re.finditer(rb"[^\0]+(?=\0[\0-\x03]\0\0\0)", data))
        if names:
            name = rng.choice(names)
            other = rng.choice((*_TEXTS[1:7], b"R", b"A", b"sh001.R", b"Z", b"a.R", b""))
            return data[: name.start()] + other + data[name.end() :]
    return _integer(data, rng) if rng.random() < 0.5 else _bits(data, rng)


def _exr_pixels(data: bytes, rng: random.Random) -> bytes:
    """Put NaN, infinity and huge numbers among the pixels, which may be uncompressed."""
    found = parse(data)
    if found is None or len(found.rest) < 64:
        return _bits(data, rng)
    rest = bytearray(found.rest)
    for _ in range(rng.choice((1, 3, 20))):
        layout = rng.choice(("<e", "<f"))
        bits = {"<e": (0x7C00, 0xFE00, 0x7BFF), "<f": (0x7F800000, 0x7FC00000, 0x7F7FFFFF)}[layout]
        width = struct.calcsize(layout)
        at = rng.randrange((len(rest) - width) // 4) * 4
        rest[at : at + width] = rng.choice(bits).to_bytes(width, "little")
    found.rest = bytes(rest)
    return found.packed()


# ---- other formats -------------------------------------------------------------------------------


def _png_sums(data: bytes, rng: random.Random) -> bytes:
    """Damage the data of a chunk, and correct its checksum."""
    chunks, at = [], 8
    while at + 12 <= len(data):
        size = int.from_bytes(data[at : at + 4], "big")
        chunks.append((data[at + 4 : at + 8], data[at + 8 : at + 8 + size]))
        at += 12 + size
    if not chunks:
        return _bits(data, rng)
    stated = [index for index, (kind, _) in enumerate(chunks) if kind in _PNG_COLORS]
    index = rng.choice(stated) if stated and rng.random() < 0.5 else rng.randrange(len(chunks))
    kind, body = chunks[index]
    if rng.random() < 0.2:
        kind = rng.choice((*_PNG_COLORS, b"IHDR", b"PLTE", b"tRNS", b"tEXt", b"zTXt", b"eXIf"))
    way = rng.choice((_bits, _integer, _grown, _truncated))
    chunks[index] = (kind, _profile(body, rng) if kind == b"iCCP" else way(body, rng))
    packed = (
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in chunks
    )
    return data[:8] + b"".join(packed)


def _profile(body: bytes, rng: random.Random) -> bytes:
    """Damage the ICC profile that a chunk holds compressed."""
    name, _, rest = body.partition(b"\0")
    try:
        profile = zlib.decompress(rest[1:])
    except zlib.error:
        return _bits(body, rng)
    way = rng.choice((_bits, _head_bits, _integer, _integer, _truncated, _moved_block, _zeroed))
    return name + b"\0\0" + zlib.compress(way(profile, rng))


def _zip_member(data: bytes, rng: random.Random) -> bytes:
    """Damage a member of an archive, or its name, and correct the checksums."""
    target = io.BytesIO()
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as source:
            members = [(name, source.read(name)) for name in source.namelist()]
    except Exception:  # whatever a damaged archive makes of the module
        return _bits(data, rng)
    if not members:
        return _bits(data, rng)
    index = rng.randrange(len(members))
    name, body = members[index]
    if rng.random() < 0.1:
        name = rng.choice(("\ud800.npy", "../up.npy", "\x1b]0;x\x07", "x" * 300))
    else:
        body = rng.choice((_bits, _head_bits, _truncated, _npy_header))(body, rng)
    members[index] = name, body
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for each, content in members:
            archive.writestr(each.encode("utf-8", "replace").decode(), content)
    return target.getvalue()


def _npy_header(data: bytes, rng: random.Random) -> bytes:
    """Replace an item of the header of numpy's array, which is the text of a dict."""
    shape = rng.choice((b"(True, 3)", b"(-1,)", b"(9999999999,)", b"()", b"('a',)", b"((1,),)"))
    kind = rng.choice((b"'|O'", b"'<U9'", b"'<f2'", b"'<c16'", b"[('a', '<f4')]", b"'<M8[s]'"))
    if rng.random() < 0.5:
        return re.sub(rb"\([^)]*\)", shape, data, count=1)
    return re.sub(rb"'[<|>][A-Za-z]\d+'", kind, data, count=1)


def _text_number(data: bytes, rng: random.Random) -> bytes:
    """Replace a number in a text."""
    found = list(re.finditer(rb"-?\d[\d.eE+-]*", data[:20_000]))
    if not found:
        return _bits(data, rng)
    chosen = rng.choice(found)
    return data[: chosen.start()] + rng.choice(_NUMBERS).encode() + data[chosen.end() :]


def _text_string(data: bytes, rng: random.Random) -> bytes:
    """Replace a text within quotes by another of the file, or by anything."""
    found = list(re.finditer(rb'(?<=")[^"\n]*(?=")', data[:20_000]))
    if not found:
        return _text_number(data, rng)
    chosen = rng.choice(found)
    new = rng.choice((rng.choice(found)[0], rng.choice(_TEXTS), rng.choice(_ODD), b"xyz"))
    return data[: chosen.start()] + new + data[chosen.end() :]


def _text_line(data: bytes, rng: random.Random) -> bytes:
    """Drop, repeat or replace a line of a text."""
    lines = data.split(b"\n")
    index = rng.randrange(len(lines))
    count = rng.choice((0, 2, 300))
    line = rng.choice((lines[index], lines[index], rng.choice(_TEXTS)))
    lines[index : index + 1] = [line] * count
    return b"\n".join(lines)
