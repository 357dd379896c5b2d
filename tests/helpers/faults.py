"""Faults of the system, one at a time: the n-th call that changes files fails, or its process is killed."""

from __future__ import annotations

import builtins
import errno
import io
import os
import signal
import warnings
from contextlib import contextmanager

ERRORS = (errno.ENOSPC, errno.EIO, errno.EACCES)

# Functions of `os` that are counted.
_CALLS = ("open", "mkdir", "rmdir", "unlink", "rename", "replace", "fsync", "write", "truncate", "link")
KILL = "kill"


class Faults:
    """Count of the calls of the system since the block began; the one of a number fails."""

    def __init__(self, number=None, fault=KILL):
        self.number, self.fault = number, fault
        self.calls = []

    def call(self, name, path=None):
        """Count a call, and have it fail if it is its turn."""
        self.calls.append(name)
        if len(self.calls) == self.number:
            if self.fault == KILL:
                os.kill(os.getpid(), signal.SIGKILL)
            raise OSError(self.fault, os.strerror(self.fault), *([] if path is None else [os.fspath(path)]))


class _Written:
    """A file open for writing, each call of which is counted; a write that fails has written half."""

    def __init__(self, file, faults):
        self._file, self._faults = file, faults

    def __getattr__(self, name):
        return getattr(self._file, name)

    def __iter__(self):
        return iter(self._file)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.close()

    def write(self, content):
        try:
            self._faults.call("write")
        except OSError:
            self._file.write(content[: len(content) // 2])
            raise
        return self._file.write(content)

    def writelines(self, lines):
        for line in lines:
            self.write(line)

    def flush(self):
        self._faults.call("flush")
        self._file.flush()

    def close(self):
        if not self._file.closed:
            self._file.close()
            self._faults.call("close")


@contextmanager
def faulty(number=None, fault=KILL):
    """Have the call of this number fail in the block, counted from one; without a number, count."""
    faults = Faults(number, fault)
    usual = {name: getattr(os, name) for name in _CALLS if hasattr(os, name)}
    usual_open = builtins.open

    def counted(name):
        def call(*arguments, **options):
            faults.call(name, arguments[0] if isinstance(arguments[0], str | bytes | os.PathLike) else None)
            return usual[name](*arguments, **options)

        return call

    def opened(file, mode="r", *arguments, **options):
        if not set(mode) & set("wax+"):
            return usual_open(file, mode, *arguments, **options)
        faults.call("open", file if isinstance(file, str | bytes | os.PathLike) else None)
        return _Written(usual_open(file, mode, *arguments, **options), faults)

    for name in usual:
        setattr(os, name, counted(name))
    builtins.open = io.open = opened
    try:
        yield faults
    finally:
        builtins.open = io.open = usual_open
        for name, call in usual.items():
            setattr(os, name, call)


def killed(number, write, *arguments):
    """Run a writer in a process that is killed at the call of this number; whether it was."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of a fork beside threads: this child only writes
        child = os.fork()
    if child == 0:
        try:
            with faulty(number):
                write(*arguments)
        finally:
            os._exit(0)
    return os.WIFSIGNALED(os.waitpid(child, 0)[1])
