"""URLs: what is one, and how it may be shown, without the passwords and signatures in it."""

import os
import re

SCHEME = re.compile(r"([A-Za-z][A-Za-z0-9+.-]+)://")
"""The start of a URL. A single letter before the colon is a drive of Windows."""
_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:/{1,2}[^\s'\"<>]+")
"""A URL in a text. One that was taken for a path has lost a slash."""
_LOGIN = re.compile(r"(?:(?<=://)[^/\s]*|[^/\s:]+:[^/\s]*)@")
"""The user and the password of a URL, also where a message leaves its scheme out."""
_SIGNATURE = re.compile(r"\?[^\s?=]*=[^\s'\",)]*")
"""The query of a URL, which signs addresses that may be opened without a password."""


def is_remote(name: str | os.PathLike[str]) -> bool:
    """Whether a name is a URL, such as ``s3://bucket/a.exr``, and not a path."""
    return SCHEME.match(os.fspath(name)) is not None


def is_url(path: str | os.PathLike[str]) -> bool:
    """Whether a path was a URL before it was taken for a path, which leaves it one slash."""
    return re.match(r"[A-Za-z][A-Za-z0-9+.-]+:/", os.fspath(path)) is not None


def shown(url: str) -> str:
    """Return a URL as it may be printed: without password, and without the query that signs it.

    Texts of libraries about URLs, which may leave out the scheme, can be given too.
    """
    return _SIGNATURE.sub("?...", _LOGIN.sub("***@", url))


def without_secrets(text: str) -> str:
    """Return a text in which every URL is as `shown` has it, and all else as it was."""
    if ":/" not in text:
        return text
    return _URL.sub(lambda found: shown(found[0]), text)


def has_secret(name: str) -> bool:
    """Whether a name is a URL that says more than may be shown."""
    return is_remote(name) and shown(name) != name
