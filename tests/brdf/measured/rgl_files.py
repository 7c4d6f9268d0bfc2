"""RGL's tensor files, written from the format's description without `shrm`."""

import struct

import numpy as np

TYPES = {"u1": 1, "u2": 3, "u4": 5, "f4": 10, "f8": 11}


def tensor_file(fields, version=(1, 0), count=None):
    """Bytes of a tensor file; fields are arrays by name, or (offset, shape, type) to lie about."""
    size = 18 + sum(13 + len(name) + 8 * len(shape_of(each)) for name, each in fields.items())
    header = b"tensor_file\0" + bytes(version)
    header += struct.pack("<I", len(fields) if count is None else count)
    data = b""
    for name, each in fields.items():
        if isinstance(each, tuple):
            offset, shape, kind = each
        else:
            offset, shape, kind = size + len(data), each.shape, each.dtype.str[1:]
            data += each.tobytes()
        header += struct.pack("<H", len(name)) + name.encode()
        header += struct.pack("<HBQ", len(shape), TYPES[kind], offset)
        header += struct.pack(f"<{len(shape)}Q", *shape)
    assert len(header) == size
    return header + data


def shape_of(each):
    return each[1] if isinstance(each, tuple) else each.shape


def material(**changes):
    """Fields of a small isotropic material; `changes` replace some, None removes one."""
    rng = np.random.default_rng(8)
    angles = np.array([0.0, 0.6, 1.1, np.pi / 2])
    fields = {
        "description": np.frombuffer(b"made for a test", dtype="u1"),
        "phi_i": np.zeros(1, dtype="f4"),
        "theta_i": angles.astype("f4"),
        "sigma": np.tile(np.linspace(1, 0.3, 9), (2, 1)).astype("f4"),
        "ndf": np.tile(np.linspace(2, 0.1, 9), (2, 1)).astype("f4"),
        "vndf": rng.uniform(0.2, 1, (1, 4, 7, 6)).astype("f4"),
        "luminance": rng.uniform(0.2, 1, (1, 4, 5, 5)).astype("f4"),
        "rgb": rng.uniform(0.1, 2, (1, 4, 3, 5, 5)).astype("f4"),
        "jacobian": np.ones(1, dtype="u1"),
        **changes,
    }
    return {name: each for name, each in fields.items() if each is not None}


def brushed(symmetry=1, **changes):
    """Fields of a small anisotropic material that is measured over a part of the circle.

    The azimuths are at uneven steps, and all that depends on them does so strongly. `symmetry` is
    how often their span fits into the circle; 2 is half a turn, 4 two mirrors.
    """
    rng = np.random.default_rng(9)
    steps = np.array([0, 0.13, 0.4, 0.55, 0.83, 1])
    azimuths = -np.pi + steps * 2 * np.pi / symmetry
    count = len(azimuths)
    fields = {
        "phi_i": azimuths.astype("f4"),
        "sigma": rng.uniform(0.3, 1, (7, 9)).astype("f4"),
        "ndf": rng.uniform(0.1, 2, (8, 9)).astype("f4"),
        "vndf": rng.uniform(0.2, 1, (count, 4, 7, 6)).astype("f4"),
        "luminance": rng.uniform(0.2, 1, (count, 4, 5, 5)).astype("f4"),
        "rgb": rng.uniform(0.1, 2, (count, 4, 3, 5, 5)).astype("f4"),
    }
    return material(**{**fields, **changes})
