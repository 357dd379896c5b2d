"""NetCDF files with checksums: what is damaged is refused, or read as it was."""

import json
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

from helpers.record_tables import WIRE, columns
from helpers.refusals import refused
from tactile_bayes.errors import RecordError, TactileBayesError
from tactile_bayes.inference.result import read_result, write_result
from tactile_bayes.record import make_record, read_record, write_record
from tactile_bayes.record.netcdf import read_netcdf, write_netcdf

SEAL = b"\ntactile_bayes: SHA-256 of all bytes before this line "


def small_posterior():
    """A tree with what a posterior has: groups, numbers, scalars, strings, attributes."""
    rng = np.random.default_rng(1)
    draws = xr.Dataset(
        {name: (("chain", "draw"), rng.normal(size=(4, 50)), {"units": "m"}) for name in ("a", "q")},
        coords={"chain": np.arange(4), "draw": np.arange(50)},
        attrs={"created": "today"},
    )
    stats = xr.Dataset({"r_hat": ("parameter", [1.0, 1.01]), "seconds": 3.5}, {"parameter": ["a", "quite long"]})
    attrs = {"family": "parabola", "seed": 1, "priors": "{}", "limits": [1.0, 2.0]}
    return xr.DataTree.from_dict({"/": xr.Dataset(attrs=attrs), "posterior": draws, "sample_stats": stats})


def write_both(folder):
    """A record and a posterior; each with its reader."""
    record, posterior = folder / "record.nc", folder / "posterior.nc"
    write_record(make_record(columns(note=["", "a", "bc", "ß", "", "d"]), rod=WIRE, attrs={"run": 5}), record)
    write_result(small_posterior(), posterior)
    return {record: read_record, posterior: read_result}


def damaged(content, rng):
    """The content with bytes flipped, zeroed, exchanged or cut off."""
    at, size = int(rng.integers(len(content))), int(2 ** rng.uniform(0, 13))
    match int(rng.integers(6)):
        case 0 | 1:
            flipped = bytearray(content)
            for place in rng.integers(0, len(content), int(rng.integers(1, 4))):
                flipped[place] ^= 1 << int(rng.integers(8))
            return bytes(flipped)
        case 2:
            return content[:at] + bytes(len(content[at : at + size])) + content[at + size :]
        case 3:
            return content[:at] + rng.bytes(len(content[at : at + size])) + content[at + size :]
        case 4:
            return content[:at] + content[at + size :]
        case _:
            return content[:at]


def outcomes(cases, folder, seed):
    """What becomes of damaged files: "refused", or "read" as before; else "read otherwise", or an unclear message."""
    rng, found = np.random.default_rng(seed), Counter()
    for path, read in write_both(folder).items():
        content, whole = path.read_bytes(), read(path)
        for _ in range(cases // 2):
            path.write_bytes(damaged(content, rng))
            try:
                found["read" if read(path).identical(whole) else "read otherwise"] += 1
            except TactileBayesError as error:
                found["refused" if str(error).startswith(f"{path}") else str(error)] += 1
    return found


def test_damaged_files_are_refused_or_read_as_they_were(tmp_path):
    found = outcomes(100, tmp_path, seed=1)
    assert set(found) <= {"refused", "read"}
    assert found["refused"] > 70


@pytest.mark.slow
def test_many_damaged_files_end_no_process(tmp_path):
    """In a process of its own, as HDF5 reads some damaged files for ever, or ends the process over them."""
    words = f"import json, sys; sys.path.insert(0, {str(Path(__file__).parents[1])!r}); from pathlib import Path; "
    words += "from record.test_netcdf import outcomes; "
    words += f"print(json.dumps(outcomes(4000, Path({str(tmp_path)!r}), seed=2)))"
    command = [sys.executable, "-W", "error", "-c", words]
    process = subprocess.run(command, capture_output=True, text=True, timeout=900, check=False)
    assert process.returncode == 0, process.stderr
    found = json.loads(process.stdout)
    assert set(found) <= {"refused", "read"}
    assert sum(found.values()) == 4000
    assert found["refused"] > 3000


def test_every_byte_counts(tmp_path):
    """Each of the file but those of the last line's own beginning, where nothing but the line is damaged."""
    path = tmp_path / "a.nc"
    write_netcdf(xr.Dataset({"q": ("draw", [0.5, 0.6])}, attrs={"a": 1}), path)
    content = path.read_bytes()
    for at in (0, 9, 40, 100, len(content) // 2, len(content) - 140, len(content) - 60, len(content) - 1):
        path.write_bytes(content[:at] + bytes([content[at] ^ 4]) + content[at + 1 :])
        with refused(RecordError, "damaged"):
            read_netcdf(path, xr.open_dataset, lambda what: RecordError(f"a file {what}"))


def test_numbers_and_characters_have_checksums_that_hdf5_checks(tmp_path):
    with_scalar = xr.Dataset(
        {"x": ("n", [1.0, 2.0]), "none": ("empty", np.zeros(0)), "one": 1.0, "word": ("n", ["a", "b"])}
    )
    write_netcdf(with_scalar, tmp_path / "a.nc")
    write_record(make_record(columns()), tmp_path / "record.nc")
    with h5py.File(tmp_path / "a.nc") as file:
        assert {name: file[name].fletcher32 for name in ("x", "none", "one", "word")} == {
            "x": True,
            "none": False,
            "one": False,
            "word": False,
        }
    with h5py.File(tmp_path / "record.nc") as file:
        assert all(file[name].fletcher32 for name in make_record(columns()))
        place = file["force_x"].id.get_chunk_info(0).byte_offset
    xr.testing.assert_identical(read_netcdf(tmp_path / "a.nc", xr.open_dataset, ValueError), with_scalar)
    content = (tmp_path / "record.nc").read_bytes()
    (tmp_path / "record.nc").write_bytes(content[:place] + b"\1" + content[place + 1 : content.index(SEAL)])
    with refused(RecordError, "damaged"):
        read_record(tmp_path / "record.nc")


def test_a_file_that_another_program_writes_or_changes_is_read(tmp_path):
    """HDF5 drops the last line as it opens a file to change it."""
    record = make_record(columns())
    write_record(record, tmp_path / "a.nc")
    assert (tmp_path / "a.nc").read_bytes()[-120:].count(SEAL) == 1
    with h5py.File(tmp_path / "a.nc", "r+") as file:
        file["force_y"][1] = 0.625
    assert read_record(tmp_path / "a.nc")["force_y"].values[1] == 0.625
    record.to_netcdf(tmp_path / "b.nc", engine="h5netcdf")
    assert read_record(tmp_path / "b.nc").equals(record)


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="all may be read")
def test_what_the_system_refuses_is_no_damage(tmp_path):
    write_record(make_record(columns()), tmp_path / "a.nc")
    (tmp_path / "a.nc").chmod(0)
    with pytest.raises(PermissionError):
        read_record(tmp_path / "a.nc")
