"""Files written whole, of which a reader sees the old or the new one and never half of either; folders for one run."""

from __future__ import annotations

import errno
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

__all__ = ["alone_in", "write_atomically"]


@contextmanager
def write_atomically(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary path to write to, and put it in the place of `path` when the block has succeeded.

    The temporary file lies in the same directory and has the same suffix. At the end of the block it is brought
    to the disk, renamed, and the directory is brought to the disk; if the block raises, it is removed and what
    was at `path` stays as it was.

    Parameters
    ----------
    path : path-like
        The file to be written. A symbolic link is followed.

    Yields
    ------
    pathlib.Path
        Where the block has to write.

    Raises
    ------
    FileNotFoundError
        If the folder of `path` is not there, or the block wrote no file.

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
    temporary = target.with_name(f".{secrets.token_hex(8)}.tmp{target.suffix}")
    try:
        yield temporary
        with open(temporary, "r+b") as written:
            os.fsync(written.fileno())
        os.replace(temporary, target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    if os.name != "nt":  # Windows cannot open a directory, and its rename is journalled anyway
        directory = os.open(target.parent, os.O_RDONLY)
        try:
            os.fsync(directory)
        finally:
            os.close(directory)


@contextmanager
def alone_in(folder: Path, refusal: type[Exception]) -> Iterator[None]:
    """Keep other runs out of a folder, where the system can; the lock goes with the process.

    Raises
    ------
    Exception
        Of the type `refusal`, if another run is at work there.
    """
    try:
        import fcntl
    except ImportError:  # Windows: nothing keeps the second run out
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise refusal(f"another run is at work on {folder}: wait for it, or stop it") from None
        except OSError:  # a file system without locks
            pass
        yield
    finally:
        os.close(handle)
