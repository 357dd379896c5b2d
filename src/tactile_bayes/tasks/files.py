"""Atomic writes, so that a reader sees the old or the new file and never a part; folders for a single run."""

from __future__ import annotations

import errno
import hashlib
import os
import platform
import re
import secrets
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

__all__ = ["alone_in", "is_temporary", "write_atomically"]

_HOST = hashlib.sha256(platform.node().encode()).hexdigest()[:8]
_TEMPORARY = re.compile(r"\.tactile-bayes-(?P<host>[0-9a-f]{8})-[0-9a-f]{16}\.tmp")
_DAY = 86_400.0


@contextmanager
def write_atomically(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path to write to, and move it to `path` when the block has succeeded.

    The temporary file has the same name, in a hidden folder beside `path`, which is locked while it exists. At the end
    of the block the file is flushed to the disk and renamed, and the directory is flushed; if the block raises, the
    temporary file is removed and `path` stays as it was.

    Processes that were killed leave such folders behind. They are removed first if their lock shows that nobody writes
    to them: not on Windows, nor on a file system without locks. Since locks may not reach other machines, folders from
    another machine must also be a day old.

    Parameters
    ----------
    path : path-like
        File to be written. A symbolic link is followed.

    Yields
    ------
    pathlib.Path
        Temporary path for the block to write to.

    Raises
    ------
    FileNotFoundError
        If the folder of `path` does not exist, or the block wrote no file.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as directory:
    ...     target = Path(directory) / "answer.txt"
    ...     with write_atomically(target) as temporary:
    ...         _ = temporary.write_text("42")
    ...     target.read_text()
    '42'
    """
    target = Path(path).resolve()
    if not target.parent.is_dir():  # else the refusal would name the temporary file
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(target.parent))
    _remove_leftovers(target.parent)
    with _hidden_folder(target.parent) as folder:
        temporary = folder / target.name
        yield temporary
        with open(temporary, "r+b") as written:
            os.fsync(written.fileno())
        os.replace(temporary, target)
    if os.name != "nt":  # Windows cannot open a directory, and its rename is journalled anyway
        directory = os.open(target.parent, os.O_RDONLY)
        try:
            os.fsync(directory)
        finally:
            os.close(directory)


def is_temporary(path: Path) -> bool:
    """Return whether a path has the name of a folder of `write_atomically`."""
    return _TEMPORARY.fullmatch(path.name) is not None


@contextmanager
def _hidden_folder(parent: Path) -> Iterator[Path]:
    """Create a locked folder, and remove it at the end."""
    while True:
        folder = parent / f".tactile-bayes-{_HOST}-{secrets.token_hex(8)}.tmp"
        folder.mkdir()
        with suppress(FileNotFoundError, BlockingIOError):  # another process took it for a leftover at once
            handle = _lock(folder)
            if handle is None or folder.exists():
                break
            os.close(handle)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        if handle is not None:
            os.close(handle)


def _remove_leftovers(parent: Path) -> None:
    """Remove hidden folders of killed processes, where they can be identified and removed."""
    with suppress(OSError):
        for name in os.listdir(parent):
            if match := _TEMPORARY.fullmatch(name):
                with suppress(OSError):
                    folder = parent / name
                    is_old = time.time() - folder.stat().st_mtime > _DAY
                    handle = _lock(folder) if match["host"] == _HOST or is_old else None
                    if handle is not None:
                        shutil.rmtree(folder, ignore_errors=True)
                        os.close(handle)


def _lock(folder: Path) -> int | None:
    """Lock a folder until the handle is closed or the process ends; None where the system has no locks.

    Raises
    ------
    BlockingIOError
        If it is locked already.
    """
    try:
        import fcntl
    except ImportError:  # Windows
        return None
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(handle)
        if isinstance(error, BlockingIOError):
            raise
        return None  # a file system without locks
    return handle


@contextmanager
def alone_in(folder: Path, refusal: type[Exception]) -> Iterator[None]:
    """Create a folder if it is missing, and keep other runs out of it where the system has locks.

    The lock ends with the process.

    Raises
    ------
    Exception
        Of the type `refusal`, if there is a file in its place, or another run is at work there.
    """
    if folder.exists() and not folder.is_dir():
        raise refusal(f"{folder} is a file: give a folder")
    folder.mkdir(parents=True, exist_ok=True)
    try:
        handle = _lock(folder)
    except BlockingIOError:
        raise refusal(f"another run is at work on {folder}: wait for it, or stop it") from None
    try:
        yield
    finally:
        if handle is not None:
            os.close(handle)
