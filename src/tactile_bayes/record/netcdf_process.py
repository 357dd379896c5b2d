"""A process that reads a NetCDF file of unknown origin, over which HDF5 may crash, hang, or take all memory."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from signal import Signals

from tactile_bayes.record import netcdf_content
from tactile_bayes.record.netcdf_content import FileGroup, UnsafeError, is_cut_short, received, time_limit


def content_elsewhere(content: bytes, with_groups: bool) -> dict[str, FileGroup]:
    """Return what `content_of` returns, or raise what it raises, from a process with limits of time and memory.

    The process runs a script, not a function of multiprocessing: it then needs no `__main__` that can be imported, and
    a worker, which may have no processes of multiprocessing, can start it.
    """
    if is_cut_short(content):
        raise ValueError("it is no HDF5, or has fewer bytes than it states")
    if not sys.executable or getattr(sys, "frozen", False):
        raise OSError("a file without its checksum is read by a Python of its own, and there is none here")
    seconds, patience = time_limit(len(content))
    command = [sys.executable, "-P", "-W", "ignore", netcdf_content.__file__, *(["groups"] if with_groups else [])]
    paths = os.pathsep.join(path for path in sys.path if path)
    environment = {**os.environ, "PYTHONPATH": paths, "OPENBLAS_NUM_THREADS": "1"}
    try:
        process = subprocess.run(
            command, input=content, capture_output=True, timeout=patience, env=environment, check=False
        )
    except subprocess.TimeoutExpired:
        raise ValueError(f"HDF5 takes more than {patience} s over it") from None
    answer = io.BytesIO(process.stdout)
    kind = answer.readline()
    if process.returncode == 0 and kind == b"content\n":
        return received(answer)
    if process.returncode == 0 and kind in (b"unsafe\n", b"damaged\n"):
        error = UnsafeError if kind == b"unsafe\n" else ValueError
        raise error(answer.read().decode("utf-8", "replace"))
    if process.returncode < 0 and Signals(-process.returncode).name in ("SIGXCPU", "SIGKILL"):
        raise ValueError(f"HDF5 takes more than {seconds} s over it, or all memory")
    said = process.stderr.decode("utf-8", "replace").strip().splitlines()
    raise ValueError(f"HDF5 ends over it with {process.returncode}" + (f": {said[-1]}" if said else ""))
