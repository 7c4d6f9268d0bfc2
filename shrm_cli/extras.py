"""The packages that some work needs besides those of shrm itself, and how to install them.

Messages name the packages, and not an extra of the distribution: that works however shrm came to
the machine. The table repeats the extras of pyproject.toml, because reading them from the metadata
of what is installed is slow, and there are none where the source tree is used as it is.
tests/test_extras.py holds both equal, and every message and page to what is worded here.
"""

EXTRAS = {
    "plots": ("matplotlib",),
    "flip": ("flip-evaluator",),
    "lookdev": ("pillow",),
    "mesh": ("trimesh", "embreex"),
    "charts": ("xatlas",),
    "cluster": ("distributed", "threadpoolctl", "cryptography"),
    "parquet": ("pyarrow",),
    "remote": ("fsspec",),
    "export": ("zstandard",),
    "astc": ("astc-encoder-py",),
    "torch": ("torch",),
    "materialx": ("MaterialX",),
    "usd": ("usd-core",),
}
"""The packages of each extra that users may want."""
STORES = {
    "s3": "s3fs",
    "s3a": "s3fs",
    "gs": "gcsfs",
    "gcs": "gcsfs",
    "abfs": "adlfs",
    "az": "adlfs",
    "http": "aiohttp",
    "https": "aiohttp",
    "sftp": "paramiko",
    "ssh": "paramiko",
}
"""The package by which fsspec reaches the usual kinds of store, by the scheme of their URLs."""


def install(extra: str) -> str:
    """Return the command that installs an extra, such as "pip install trimesh embreex"."""
    return " ".join(("pip install", *EXTRAS[extra]))


def install_store(scheme: str) -> str:
    """Return the command that installs what reaches a kind of store.

    `scheme` is that of its URLs, such as "s3"; upper case is the same.

    Returns words such as "pip install s3fs"; "install it", where fsspec alone knows the package.
    """
    package = STORES.get(scheme.lower())
    return "install it" if package is None else f"pip install {package}"
