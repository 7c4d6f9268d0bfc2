"""Output files that appear whole or not at all, and inputs that none may replace.

Every function that opens a file for its user notes it here, whether the name came from the command
line, from the specification of a BRDF or out of a map, and every function that writes one asks. A
command does its work within `protecting`. Programs that use the library decide for themselves.

Here are made, too, the folders for files that a run writes, reads again, and removes.
"""

import atexit
import contextlib
import errno
import os
import platform
import stat
import sys
from collections.abc import Iterator
from contextvars import ContextVar
from pathlib import Path

from shrm_cli.errors import OutputError, ShrmError
from shrm_cli.messages import shown

Files = set[tuple[int, int]]
"""Devices and numbers of files; links share those of their file."""

_read: ContextVar[Files | None] = ContextVar("shrm_cli.inputs", default=None)
_made: ContextVar[Files | None] = ContextVar("shrm_cli.made", default=None)
_MARK = ".shrm-"
"""This text follows the target's name in the names of temporary files."""
_HOST = 40
"""The most characters of the machine's name in a temporary file's name."""
_ANY_WRITE = 0o222
"""The bits of a file's mode of which one at least says that it may be written."""
_FULL = (errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC))
"""What the system says of a write for which there is no room; it names no file then."""
_STEM = 40
"""The most characters of the target's name in a temporary file's name, which may have 255 bytes."""
_BLOCK = 2**20
"""The bytes of a file that are looked at together."""
_mine: dict[Path, int] = {}
"""The temporary files and folders that there may be, with the processes that make them."""


@contextlib.contextmanager
def protecting() -> Iterator[None]:
    """Within this context what was read is not overwritten."""
    read, made = _read.set(set()), _made.set(set())
    try:
        yield
    finally:
        _read.reset(read)
        _made.reset(made)


def note(*paths: str | os.PathLike[str]) -> None:
    """Note files as read, but for those that were made here.

    Files that do not exist, or have names that no file can have, are left to the function that
    opens them.
    """
    known = _read.get()
    if known is None:
        return
    for path in paths:
        with contextlib.suppress(OSError, ValueError):
            known |= {_identity(path)} - (_made.get() or set())


def note_made(path: str | os.PathLike[str]) -> None:
    """Note a file as made here: who reads it back may overwrite it."""
    made = _made.get()
    if made is not None:
        with contextlib.suppress(OSError, ValueError):
            made.add(_identity(path))


def is_input(path: str | os.PathLike[str]) -> bool:
    """Whether a name leads to a file that was read, through links too."""
    try:
        return _identity(path) in (_read.get() or ())
    except (OSError, ValueError):
        return False


def _identity(path: str | os.PathLike[str]) -> tuple[int, int]:
    status = os.stat(path)
    return status.st_dev, status.st_ino


_kept: ContextVar[frozenset[str]] = ContextVar("shrm_cli.kept", default=frozenset())
"""Names of files that `replacing` replaces by their like only."""


@contextlib.contextmanager
def keeping(*targets: str | os.PathLike[str]) -> Iterator[None]:
    """Within this context, files that exist are replaced by files of the same bytes only.

    The same inputs and options give the same bytes, so that what others have made stays. What is
    cut off, or ends in zeros, is the same file if it begins so.
    """
    before = _kept.set(_kept.get() | {os.fspath(target) for target in targets})
    try:
        yield
    finally:
        _kept.reset(before)


_together: ContextVar[list[tuple[Path, Path]] | None] = ContextVar("together", default=None)
"""The temporary files and the targets that wait for the end of a block of `together`."""


def check_regular(
    path: str | os.PathLike[str], error: type[ShrmError], what: str, missing: str = ""
) -> os.stat_result:
    """Return the status of a file that can be opened: a pipe would be waited for, a device not end.

    Raises `error`, in a line that says to name `what`, or else what to do where it is `missing`.
    """
    said = shown(str(path))
    try:
        status = os.stat(path)
    except FileNotFoundError:
        raise error(f"{said}: no such file; {missing or f'name {what}'}") from None
    except (OSError, ValueError) as problem:  # such as a name too long, or with a null
        reason = getattr(problem, "strerror", None) or "a name that no file can have"
        raise error(f"{said}: cannot be opened ({reason}); check its name") from None
    if not stat.S_ISREG(status.st_mode):
        kind = "a directory" if stat.S_ISDIR(status.st_mode) else "not a regular file"
        raise error(f"{said}: {kind}; name {what}")
    return status


def check_target(
    target: str | os.PathLike[str], suffixes: tuple[str, ...] = (), makes_folder: bool = False
) -> None:
    """Check, before the work begins, that an output can be written and is none of the inputs.

    `suffixes` are the suffixes that the target's name may have, in lower case; by default any.
    `makes_folder` tells whether a folder that is missing will be made for it.
    """
    if os.fspath(target).endswith((os.sep, os.altsep or os.sep)):  # which a Path forgets
        raise OutputError(f"{target}: a directory; name a file to write")
    try:
        _check_target(Path(target), makes_folder)
    except OSError as error:  # a name may be too long, for example
        raise OutputError(
            f"{target}: cannot be written ({error.strerror}); name another output"
        ) from error
    except UnicodeError as error:
        raise OutputError(f"{target}: {fault_of_name(target)}, or name another output") from error
    if suffixes and Path(target).suffix.lower() not in suffixes:
        raise OutputError(f"{target}: what is written is {', '.join(suffixes)}; name it so")


def fault_of_name(path: str | os.PathLike[str]) -> str:
    """Say why image libraries, which take UTF-8, cannot take a name, and what to do.

    Bytes that Python cannot decode may be no UTF-8, or letters that the encoding of the locale
    lacks.
    """
    try:
        os.fsencode(path).decode()
    except UnicodeError:
        return "its name is not UTF-8; give it one that is"
    encoding = sys.getfilesystemencoding()
    return f"its name has letters that the locale's encoding, {encoding}, lacks; set LC_ALL=C.UTF-8"


def _check_target(target: Path, makes_folder: bool) -> None:
    str(target).encode()  # image libraries take UTF-8 names only
    if not target.name:
        raise OutputError(f"{target}: a directory; name a file to write")
    folder = target.parent
    if makes_folder:
        folder = next((each for each in target.parents if each.exists()), folder)
    if target.is_dir():
        raise OutputError(f"{target}: a directory; name a file to write")
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"{target}: {folder} is a file, not a folder; name another output")
    if not folder.exists():
        raise OutputError(f"{target}: there is no folder {folder}; make it first")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OutputError(f"{target}: no permission to write in {folder}; name another output")
    _check_replaceable(target)


def _check_replaceable(target: Path) -> None:
    """Refuse to replace an input, a device, a pipe, or a file that nobody may write."""
    if not target.exists():
        return
    if not target.is_file():
        raise OutputError(f"{target}: not a regular file; name another output")
    if is_input(target):
        raise OutputError(f"{target}: would overwrite the input; name another output")
    if not target.stat().st_mode & _ANY_WRITE:
        raise OutputError(f"{target}: read-only; change its mode or name another output")


@contextlib.contextmanager
def replacing(target: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield the name of a temporary file that becomes the target when the block succeeds.

    The file lies beside the target and has its suffix. If the block fails or is interrupted, the
    temporary file is removed and the target stays as it was. A killed process can leave a
    temporary file behind; the next process that writes the same target removes it.

    Raises OutputError if the target is not a regular file or is an input, if it is kept (see
    `keeping`) and is neither the new file nor a part of it, or if the block raises an OSError, such
    as for a full disk.
    """
    target = Path(target)
    prefix = own_prefix(target.stem[:_STEM])
    for left in abandoned(target.parent, prefix, target.suffix):
        discard(left)
    temporary = target.with_name(f"{prefix}{os.getpid()}-{os.urandom(4).hex()}{target.suffix}")
    try:
        _check_replaceable(target)
        claim(temporary)
        yield temporary
        with open(temporary, "rb+") as stream:
            os.fsync(stream.fileno())
        if str(target) in _kept.get() and target.exists():
            import filecmp  # rarely needed

            is_same = filecmp.cmp(temporary, target, shallow=False)
            if not is_same and not _is_cut(target, temporary):
                raise exists_error(target, "other inputs or options made it")
        waiting = _together.get()
        if waiting is None:
            os.replace(temporary, target)
            note_made(target)
        else:
            waiting.append((temporary, target))
    except OSError as error:
        if not target.parent.exists():
            why = f"there is no folder {target.parent}; make it first"
        else:
            why = f"cannot be written ({error.strerror or error}); make room or name another output"
        raise OutputError(f"{target}: {why}") from error
    finally:
        if (temporary, target) not in (_together.get() or ()):
            discard(temporary)


def _is_cut(target: Path, whole: Path) -> bool:
    """Whether a file is the beginning of another one, or that with zeros for the rest.

    Full disks and power cuts leave such files, of which nothing is lost with them.
    """
    if target.stat().st_size > whole.stat().st_size:
        return False
    with open(target, "rb") as cut, open(whole, "rb") as stream:
        while block := cut.read(_BLOCK):
            wanted = stream.read(len(block))
            if block != wanted:
                begun = block.rstrip(b"\0")
                rest = iter(lambda: cut.read(_BLOCK), b"")
                return wanted.startswith(begun) and not any(each.strip(b"\0") for each in rest)
    return True


def write_bytes(target: str | os.PathLike[str], data: bytes) -> None:
    """Write a file, whole or not at all; see `replacing`."""
    with replacing(target) as temporary:
        temporary.write_bytes(data)


@contextlib.contextmanager
def together() -> Iterator[None]:
    """Context manager within which files become their targets at its end, or none of them does."""
    waiting: list[tuple[Path, Path]] = []
    token = _together.set(waiting)
    try:
        yield
        for temporary, target in waiting:
            try:
                os.replace(temporary, target)
                note_made(target)
            except OSError as error:
                raise OutputError(
                    f"{target}: cannot be written ({error.strerror}); name another output"
                ) from error
    finally:
        _together.reset(token)
        for temporary, _ in waiting:
            discard(temporary)


def cut_off_error() -> OSError:
    """Return the error of a file that has no end, though the library that wrote it reports none."""
    return OSError(0, "it was not written whole; is the disk full?")


def exists_error(target: str | os.PathLike[str], why: str) -> OutputError:
    """Return the error that refuses to replace a file which others made."""
    return OutputError(
        f"{target}: exists, and {why}; give `force` to replace it, or name another `output`"
    )


def claim(temporary: Path) -> None:
    """Have a temporary file or folder removed when this process ends, if it is there still."""
    _mine[temporary] = os.getpid()


def discard(temporary: Path) -> None:
    """Remove a temporary file or folder, if it is there."""
    with contextlib.suppress(OSError):
        if temporary.is_dir():
            import shutil

            shutil.rmtree(temporary)
        else:
            temporary.unlink(missing_ok=True)
    _mine.pop(temporary, None)


@atexit.register
def _discard_all() -> None:
    """Remove what a signal has left, which may come before a context manager begins to clean up."""
    for temporary, process in list(_mine.items()):
        if process == os.getpid():  # a process that was forked has those of its parent in the list
            discard(temporary)


def own_prefix(name: str) -> str:
    """Return what the names of this machine's temporary files begin with, before a process number.

    It holds the machine's name, because machines that share a folder do not share the numbers.
    """
    return f".{name}{_MARK}{platform.node()[:_HOST]}-"


def abandoned(folder: Path, prefix: str, suffix: str = "") -> list[Path]:
    """Return temporary files and folders whose processes no longer run on this machine."""
    found = []
    with contextlib.suppress(OSError):
        for name in os.listdir(folder):  # which is fast, as folders may hold ten thousands
            if not (name.startswith(prefix) and name.endswith(suffix)):
                continue
            process = name[len(prefix) :].split("-")[0]
            if process.isdigit() and not _is_running(int(process)):
                found.append(folder / name)
    return found


def _is_running(process: int) -> bool:
    """Whether a process runs; one that has ended may still be listed until its parent asks."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:  # it is another user's
        pass
    try:  # Linux
        status = Path(f"/proc/{process}/stat").read_bytes()
    except OSError:
        return True
    state = status.rpartition(b")")[2].split()[0]
    return state not in (b"Z", b"X")


_NAME = "shrm"


@contextlib.contextmanager
def scratch_folder() -> Iterator[Path]:
    """Context manager that yields a new folder, which is removed at the end with all in it.

    A process that is killed leaves its folder behind; the next one that makes one there removes it.
    """
    import tempfile  # slow to load, and rarely needed

    try:
        where = Path(tempfile.gettempdir())
        prefix = own_prefix(_NAME)
        for folder in abandoned(where, prefix):
            discard(folder)
        own = Path(tempfile.mkdtemp(prefix=f"{prefix}{os.getpid()}-", dir=where))
    except OSError as error:
        raise OutputError(
            f"no temporary folder can be made ({error.strerror}); set TMPDIR to a folder with room"
        ) from error
    claim(own)
    try:
        yield own
    except OSError as error:
        if error.errno not in _FULL or error.filename is not None:
            raise
        raise OutputError(
            f"{where}: no room for temporary files ({error.strerror}); make some, or set TMPDIR "
            "to a folder that has it"
        ) from error
    finally:
        discard(own)
