"""Files that are reached by a URL: in object stores, on servers, or in another process's memory.

The package `fsspec` (the extra `remote`) opens them, with one package more for each kind of store,
such as s3fs for ``s3://``. Where a store is and who asks is told to these packages by the
environment and by their own files of settings, never by arguments of `shrm`.

The image libraries read files on disk only. So what is read is copied into a temporary file first,
a block at a time, and what is written is made on disk, whole, before it is uploaded.
"""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path, PurePath, PurePosixPath
from typing import Any
from urllib.parse import unquote

from shrm_cli.errors import RemoteError
from shrm_cli.files.whole import check_target, scratch_folder
from shrm_cli.messages import SCHEME, is_remote, shown, shown_reason, without_query

_MOST_BYTES = 2**32
"""The most bytes that are fetched of one file."""

_BLOCK = 2**22
"""Bytes that are fetched at a time."""
_PATIENCE = 20
"""Seconds in which a web server has to send something."""
_MOST_NAME = 100
"""The most characters of a temporary copy's name; file systems take 255 bytes."""


def matching(pattern: str) -> list[str]:
    """Return the URLs of the files that match a pattern, in the order of the alphabet.

    `pattern` is a URL, in which ``*``, ``?``, ``[...]`` and ``**`` mean what they mean in a shell.
    In addresses of web servers ``?`` begins the query, and servers that list no folders match
    nothing but whole addresses.
    """
    with _reached(pattern) as (system, path):
        found = system.glob(path, detail=True)
        files = sorted(name for name, facts in found.items() if facts["type"] == "file")
        return [_url_of(pattern, path, name, system) for name in files]


def exists(url: str) -> bool:
    """Whether there is a file at a URL."""
    with _reached(url) as (system, path):
        try:
            return system.info(path)["type"] == "file"
        except FileNotFoundError:
            return False


@contextlib.contextmanager
def fetched(url: str) -> Iterator[Path]:
    """Yield the path of a temporary copy, which has the name of the original and is removed after.

    It lies in a folder of its own where the system has its temporary files.
    """
    with scratch_folder() as own:
        with _reached(url) as (system, path):
            copy = own / _name_of(url)
            _download(system, path, copy, shown(url))
        yield copy


@contextlib.contextmanager
def written(output: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield the path to write, on disk; what is meant for a URL is uploaded at the end."""
    if not is_remote(output):
        check_target(output)
        yield Path(output)
        return
    url = os.fspath(output)
    with scratch_folder() as own:
        local = own / _name_of(url)
        yield local
        publish(local, url)


def publish(local: str | os.PathLike[str], url: str) -> None:
    """Upload a file so that the URL has all of it, or what it had before.

    An object of a store such as S3 appears when its upload is complete, and not before. Where a
    file grows visibly while it is written, as on disks and on SFTP servers, it is uploaded under
    another name beside the target, and renamed. File systems of the second kind are known by
    their own way to rename: fsspec's general one copies, which would gain nothing.
    """
    from fsspec import AbstractFileSystem

    with _reached(url) as (system, path):
        if type(system).mv is AbstractFileSystem.mv:
            system.put_file(os.fspath(local), path)
            return
        folder = system._parent(path)
        system.makedirs(folder, exist_ok=True)
        name = PurePosixPath(path).name
        temporary = f"{folder}/.{name[:_MOST_NAME]}.shrm-{os.urandom(8).hex()}"
        try:
            system.put_file(os.fspath(local), temporary)
            _rename(system, temporary, path)
        except BaseException:
            with contextlib.suppress(Exception):
                system.rm_file(temporary)
            raise


def _opened(url: str) -> tuple[Any, str]:
    """Return the file system of a URL and the path in it; nothing is known from an earlier call.

    File systems remember lists of files, which other processes change.
    """
    match = SCHEME.match(url)
    if match is None or "::" in url:
        raise RemoteError(f"{shown(url)}: not a single URL; name one such as s3://bucket/file")
    try:
        from fsspec.core import url_to_fs
    except ImportError as error:
        from shrm_cli.extras import install

        raise RemoteError(
            f"{shown(url)}: files elsewhere need the package fsspec; {install('remote')}"
        ) from error
    try:
        system, path = url_to_fs(url, **_limits(match[1]))
    except ImportError as error:
        from shrm_cli.extras import install_store

        raise RemoteError(
            f"{shown(url)}: {match[1]}:// needs a package that is not installed "
            f"({_reason(error)}); {install_store(match[1])}"
        ) from error
    system.invalidate_cache()
    return system, path


def _limits(scheme: str) -> dict[str, Any]:
    """Return what keeps a web server from being waited for in silence: 5 minutes, by default."""
    if scheme.lower() not in ("http", "https"):
        return {}
    from fsspec.implementations import http

    whole = http.aiohttp.ClientTimeout(total=None, sock_connect=_PATIENCE, sock_read=_PATIENCE)
    return {"client_kwargs": {"timeout": whole}}


def _download(system: Any, path: str, copy: Path, name: str) -> None:
    """Copy a file in blocks; the size that it states is not taken for what it is."""
    stated = system.info(path).get("size")
    if stated is not None and stated > _MOST_BYTES:
        raise _too_large(name, stated)
    read = 0
    with open(copy, "wb") as target, system.open(path, "rb", block_size=_BLOCK) as source:
        while block := source.read(_BLOCK):
            read += len(block)
            if read > _MOST_BYTES:
                raise _too_large(name, read)
            target.write(block)
    if stated is not None and read != stated:
        raise RemoteError(f"{name}: ended after {read:,} of {stated:,} bytes; try again")


def _too_large(name: str, size: int) -> RemoteError:
    return RemoteError(
        f"{name}: has {size:,} bytes or more, which is above {_MOST_BYTES:,}; use a smaller file"
    )


def _rename(system: Any, temporary: str, path: str) -> None:
    """Rename a file to one that may exist.

    Some servers never rename onto an existing file: SMB's, and many of FTP. There the old file is
    removed first, so that for a moment there is neither, but never half of one.
    """
    try:
        system.mv(temporary, path)
    except OSError:
        if not (system.exists(temporary) and system.exists(path)):
            raise
        system.rm_file(path)
        system.mv(temporary, path)


def _url_of(pattern: str, path: str, name: str, system: Any) -> str:
    """Return the URL of a file that a file system names, with the server that the pattern names."""
    if pattern.endswith(path):
        return pattern.removesuffix(path) + name
    return str(system.unstrip_protocol(name))


def _name_of(url: str) -> str:
    """Return a name for a file's copy on disk: the last part of its path, without any query."""
    path = without_query(url)
    if url.lower().startswith(("http://", "https://")):
        path = unquote(path)
    name = PurePath(path.replace("\0", "")).name[-_MOST_NAME:]  # on Windows `\` divides, too
    return name if name not in ("", "..") else "file"


@contextlib.contextmanager
def _reached(url: str) -> Iterator[tuple[Any, str]]:
    """Yield the file system of a URL and the path in it; what it raises becomes a RemoteError.

    Each package has exceptions of its own: those of network libraries, of missing credentials and
    of servers' refusals have no base class in common but Exception.
    """
    try:
        yield _opened(url)
    except RemoteError:
        raise
    except FileNotFoundError as error:  # which fsspec also raises for web servers that are away
        raise RemoteError(
            f"{shown(url)}: there is no such file, or its place cannot be reached; check the URL"
        ) from error
    except Exception as error:
        is_away = isinstance(error, OSError) and not isinstance(error, PermissionError)
        what = "and the network" if is_away else "the network and the credentials"
        raise RemoteError(
            f"{shown(url)}: {_reason(error)}; check the URL{' ' if is_away else ', '}{what}"
        ) from error


def _reason(error: BaseException) -> str:
    """Return what an exception says as one line that holds no password."""
    text = " ".join(str(error).split()) or type(error).__name__
    return shown_reason(text.rstrip("."))
