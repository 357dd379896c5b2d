"""Atomic writes, so that a reader sees old or new files and never a part; folders for a single run; inputs kept."""

from __future__ import annotations

import errno
import hashlib
import os
import platform
import re
import secrets
import shutil
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from tactile_bayes.checks import as_number, shown
from tactile_bayes.errors import ParameterError

_HOST = hashlib.sha256(platform.node().encode()).hexdigest()[:8]
_TEMPORARY = re.compile(r"\.tactile-bayes-(?P<host>[0-9a-f]{8})-[0-9a-f]{16}\.tmp")
_DAY = 86_400.0
_TRIES = 20


@contextmanager
def write_atomically(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path to write to, and move it to `path` when the block has succeeded, else remove it.

    It has the same name, in a hidden, locked folder beside `path`.
    """
    target = Path(path).resolve()
    with _beside(target.parent, target) as folder:
        temporary = folder / target.name
        yield temporary
        _flush(temporary)
        _move(temporary, target)
        _flush(target.parent)


@contextmanager
def replace_together(folder: Path, names: Sequence[str]) -> Iterator[Path]:
    """Yield a temporary folder for files that replace all of these names in `folder`, when the block has succeeded.

    If it raises, or a file cannot be replaced, `folder` stays as it was. Old files are never beside new ones: the first
    name is the first to go and the last to come. A single new file that is not the first replaces the old one at once.
    """
    with _beside(folder, folder) as temporary:
        yield temporary
        new = [name for name in names if (temporary / name).is_file()]
        for name in new:
            _flush(temporary / name)
        _exchange(folder, temporary, names, new)
        _flush(folder)


def _exchange(folder: Path, temporary: Path, names: Sequence[str], new: Sequence[str]) -> None:
    """Move the files of these names away, then the new ones to their places; undo all of it if a step fails."""
    former = temporary / secrets.token_hex(8)
    former.mkdir()
    old = [name for name in names if os.path.lexists(folder / name)]
    at_once = len(new) == 1 and (new[0] != names[0] or set(old) <= set(new))
    gone = [name for name in old if not (at_once and name in new)]
    away = [(folder / name, former / str(number)) for number, name in enumerate(gone)]
    if folders := [path for path in (folder / name for name in names) if path.is_dir()]:
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(folders[0]))
    moved = list[tuple[Path, Path]]()
    try:
        for source, target in [*away, *((temporary / name, folder / name) for name in reversed(new))]:
            _move(source, target)
            moved.append((source, target))
    except BaseException:
        for source, target in reversed(moved):
            _move(target, source)
        raise


def _move(source: Path, target: Path) -> None:
    """Move a file; on Windows again for a second, as other programs that look at new files keep them for a moment."""
    for _ in range(_TRIES if sys.platform == "win32" else 0):
        with suppress(PermissionError):
            os.replace(source, target)
            return
        time.sleep(1.0 / _TRIES)
    os.replace(source, target)


def refuse_replacing(outputs: Iterable[Path], inputs: Iterable[Path]) -> None:
    """Refuse to write a file from which the same call reads, under whatever name."""
    sources = list(inputs)
    for output in outputs:
        for source in sources:
            if _is_same(output, source):
                raise ParameterError(
                    f"{output} would replace {source}, which is read: give another place or name for the results"
                )


def _is_same(path: Path, other: Path) -> bool:
    try:
        return path.samefile(other)
    except OSError:  # one of them is not there yet
        return path.resolve() == other.resolve()


def check_format(stated: object, reads: int, refused: Callable[[str], Exception], oldest: int = 1) -> None:
    """Raise `refused(what)` unless a file states a format from `oldest` to `reads`; that of one without is 1."""
    found = 1.0 if stated is None else as_number(stated)
    if found is None or not (oldest <= found <= reads and found.is_integer()):
        number = shown(stated) if found is None else f"{found:g}"
        formats = f"format {reads}" if oldest == reads else f"formats {oldest} to {reads}"
        correction = "use the one that wrote it" if found is not None and found < oldest else "install a newer one"
        raise refused(f"has format {number}, and this version of tactile_bayes reads {formats} ({correction})")


def is_temporary(path: Path) -> bool:
    """Return whether a path has the name of a folder of `write_atomically`."""
    return _TEMPORARY.fullmatch(path.name) is not None


@contextmanager
def _beside(parent: Path, target: Path) -> Iterator[Path]:
    """Yield a hidden folder in a folder; errors of the system name the target instead of what is in it."""
    if not parent.is_dir():  # else the refusal would name the temporary file
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(parent))
    _remove_leftovers(parent)
    with errors_of(target):
        folder, handle = _locked_folder(parent)
        try:
            yield folder
        finally:
            _remove(folder)
            if handle is not None:
                os.close(handle)


@contextmanager
def errors_of(target: Path) -> Iterator[None]:
    """Have errors of the system in a block, which name no file or a temporary one, name the file that is written."""
    try:
        yield
    except OSError as error:
        if error.errno is None or not (error.filename is None or _in_hidden_folder(error.filename)):
            raise
        raise type(error)(error.errno, error.strerror, str(target)) from error


def _in_hidden_folder(name: Any) -> bool:
    """Return whether an error names a file in a hidden folder, or such a folder."""
    return any(map(_TEMPORARY.fullmatch, Path(os.fsdecode(name)).parts))


def _locked_folder(parent: Path) -> tuple[Path, int | None]:
    """Create a folder, and return it with its lock."""
    while True:
        folder = parent / f".tactile-bayes-{_HOST}-{secrets.token_hex(8)}.tmp"
        folder.mkdir()
        try:
            handle = _lock(folder)
            if handle is None or folder.exists():
                return folder, handle
            os.close(handle)
        except (FileNotFoundError, BlockingIOError):  # another process took it for a leftover at once
            pass
        except BaseException:
            _remove(folder)
            raise


def _remove(folder: Path) -> None:
    """Remove a folder with its content; a second try if the first one fails."""
    for _ in range(2):
        if folder.exists():
            shutil.rmtree(folder, ignore_errors=True)


def _flush(path: Path) -> None:
    """Flush a file, or the names in a folder, to the disk; not a folder of Windows, whose renames are journalled."""
    is_folder = path.is_dir()
    if is_folder and os.name == "nt":
        return
    handle = os.open(path, os.O_RDONLY if is_folder else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _remove_leftovers(parent: Path) -> None:
    """Remove hidden folders of killed processes: nobody holds their lock, which may not reach another machine."""
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
    """Lock a folder until the handle is closed or the process ends; None where the system has no locks."""
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
