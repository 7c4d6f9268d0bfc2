"""Damaged files of maps: the checks that tests of all representations make of them."""

import numpy as np
import OpenEXR
import pytest

from shrm_cli.errors import MapError
from shrm_cli.maps.file import open_map


def refused(path, *words, read=open_map):
    """Check that reading a file gives a MapError: one short line with its name and these words."""
    with pytest.raises(MapError) as caught:
        read(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    assert message.isprintable()
    assert len(message) < len(str(path)) + 200
    for word in words:
        assert word in message


def parts(path):
    """Header and channels that OpenEXR finds in a file of one part."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        assert len(file.parts) == 1
        header = {name: value for name, value in file.header().items() if name != "channels"}
        return header, {name: channel.pixels for name, channel in file.channels().items()}


def writer_of_damage(sound):
    """Return a function that writes a sound map with header and channels changed; None removes.

    A window that does not fit other channels is left to OpenEXR.
    """
    header, channels = parts(sound)

    def write(attributes=None, planes=None):
        path = sound.with_name("damaged.exr")
        changed = {**header, **(attributes or {})}, {**channels, **(planes or {})}
        kept = [{k: v for k, v in part.items() if v is not None} for part in changed]
        if planes:
            for name in ("dataWindow", "displayWindow"):
                kept[0].pop(name)
        OpenEXR.File(*kept).write(str(path))
        return path

    return write


def survives_flipped_bits(path, count, seed=0, least=40, read=open_map):
    """Check that flipped bits in a sound file give a map or a MapError of one line, nothing else.

    One bit is flipped in each of `count` bytes, and more than `least` of them must give an error.
    """
    data = path.read_bytes()
    broken_path = path.with_name("broken.exr")
    rng = np.random.default_rng(seed)
    messages = []
    for position in rng.permutation(len(data))[:count]:
        broken = bytearray(data)
        broken[position] ^= 1 << int(rng.integers(8))
        broken_path.write_bytes(broken)
        try:
            read(broken_path)
        except MapError as error:
            messages.append(str(error))
    assert len(messages) > least
    for message in messages:
        assert message.startswith(f"{broken_path}: ")
        assert "\n" not in message
