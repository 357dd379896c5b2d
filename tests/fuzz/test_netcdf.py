"""Mutated NetCDF files, with and without their checksum: read as they were, or refused, within limits."""

import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from time import monotonic

import numpy as np
import pytest
import xarray as xr

import tactile_bayes as tb
from helpers.memory import COUNTING, own_peak
from helpers.mutations import changed_bytes
from helpers.public_calls import STREAM, updated
from helpers.record_tables import WIRE, columns
from tactile_bayes.errors import TactileBayesError
from tactile_bayes.inference.result import read_result, write_result
from tactile_bayes.record import netcdf_content, write_record
from tactile_bayes.rig import Rig, make_record, read_record

# Number of files of each kind with a checksum, and without, whose reading takes half a second.
SEALED, FOREIGN = 50, 4
SEAL = b"\ntactile_bayes: SHA-256"  # beginning of the last line of a file with a checksum
# Longest time for a small file on a machine that does other work, and most memory of a process that reads it.
SECONDS, BYTES = 200.0, 1e9
# Memory of a large process [bytes]: more than a reader of a small file takes, and less than it may take.
LARGE = 400_000_000


def latest(path):
    """What is known when a stream is resumed from a file."""
    return tb.Stream.resume(path, **STREAM).latest()


@pytest.fixture(scope="module")
def originals(tmp_path_factory):
    """A record, a posterior and a stream: how each is read, what is in it, and its bytes."""
    folder, rng = tmp_path_factory.mktemp("originals"), np.random.default_rng(1)
    record = make_record(columns(note=["", "a", "bc", "ß", "", "d"]), Rig(rod=WIRE), attrs={"run": 5})
    write_record(record, folder / "record.nc")
    draws = xr.Dataset(
        {name: (("chain", "draw"), rng.normal(size=(2, 20))) for name in ("a", "q")}, attrs={"made": "now"}
    )
    stats = xr.Dataset({"r_hat": ("parameter", [1.0, 1.01]), "seconds": 3.5}, {"parameter": ["a", "quite long"]})
    tree = {"/": xr.Dataset(attrs={"family": "parabola", "limits": [1.0, 2.0]}), "posterior": draws, "stats": stats}
    write_result(xr.DataTree.from_dict(tree), folder / "posterior.nc")
    updated().save(folder / "stream.nc")
    readers = {"record.nc": read_record, "posterior.nc": read_result, "stream.nc": latest}
    return [(read, read(folder / name), (folder / name).read_bytes()) for name, read in readers.items()]


def outcome(path, content, read, whole):
    """What becomes of a file: "refused", "as it was" or "otherwise"; any other error is none of ours."""
    path.write_bytes(content)
    began = monotonic()
    try:
        found = "as it was" if read(path).identical(whole) else "otherwise"
    except TactileBayesError as error:
        found = "refused" if str(error).startswith(str(path)) else str(error)
    assert monotonic() - began < SECONDS
    return found


def test_files_with_a_checksum_are_refused_or_read_as_they_were(tmp_path, originals, fuzz_seed):
    rng, found = np.random.default_rng(fuzz_seed), Counter()
    for read, whole, content in originals:
        for _ in range(SEALED):
            found[outcome(tmp_path / "a.nc", changed_bytes(content, rng), read, whole)] += 1
    assert set(found) <= {"refused", "as it was"}
    assert found["refused"] > 0.8 * SEALED * len(originals)


def counted(reader, folder):
    """A script that runs another, and counts its memory from a small process, which starts it."""
    command = [str(folder / "used"), sys.executable, *("-P", "-W", "ignore"), str(reader)]
    script = folder / "counted.py"
    script.write_text(f"import sys\nsys.argv[1:1] = {command}\n{COUNTING}")
    return str(script)


@pytest.fixture
def peaks(tmp_path, monkeypatch):
    """Memory of the processes that have read a file so far [bytes]."""
    if sys.platform == "win32":  # there is no wait4
        return list
    monkeypatch.setattr(netcdf_content, "__file__", counted(netcdf_content.__file__, tmp_path))
    return lambda: [int(line.split()[1]) for line in (tmp_path / "used").read_text().splitlines()]


@pytest.mark.skipif(sys.platform != "linux", reason="memory is counted otherwise there")
def test_the_memory_of_readers_is_their_own(tmp_path, originals, peaks, monkeypatch):
    """Not that of a large process which has a file read; and a reader that takes as much is found."""
    read, whole, content = originals[0]
    content = content[: content.rindex(SEAL)]
    mine = np.ones(LARGE // 8)
    assert own_peak() > mine.nbytes == LARGE
    assert outcome(tmp_path / "a.nc", content, read, whole) == "as it was"
    assert 1e7 < peaks()[-1] < LARGE
    (tmp_path / "greedy.py").write_text(f"import numpy as np\nnp.ones({LARGE // 8})\n")
    monkeypatch.setattr(netcdf_content, "__file__", counted(tmp_path / "greedy.py", tmp_path))
    assert outcome(tmp_path / "a.nc", content, read, whole) == "refused"
    assert peaks()[-1] > LARGE


def test_files_without_a_checksum_are_refused_or_read_within_limits(tmp_path, originals, peaks, fuzz_seed):
    """A changed name or unit cannot be noticed, so that they may be read otherwise."""
    rng, tasks = np.random.default_rng([fuzz_seed, 1]), []
    for read, whole, content in originals[:2]:  # a stream has a checksum
        content = content[: content.rindex(SEAL)]
        assert outcome(tmp_path / "whole.nc", content, read, whole) == "as it was"
        for _ in range(FOREIGN):
            path = tmp_path / f"{len(tasks)}.nc"
            tasks.append((path, changed_bytes(content, rng), read, whole))
    with ThreadPoolExecutor(2) as pool:
        found = Counter(pool.map(lambda task: outcome(*task), tasks))
    assert set(found) <= {"refused", "as it was", "otherwise"}
    assert all(peak < BYTES for peak in peaks())
