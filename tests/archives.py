"""Unpacking the archives that tests make."""

import tarfile


def unpack(archive, folder):
    """Unpack an open archive without leaving a folder, where this Python can see to that.

    Python 3.11.2, which Debian 12 has, knows no filters; the archives here are of our own making.
    """
    safe = {"filter": "data"} if hasattr(tarfile, "data_filter") else {}
    archive.extractall(folder, **safe)
