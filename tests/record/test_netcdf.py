"""NetCDF files with checksums: what is damaged is refused, or read as it was."""

import hashlib
import json
import multiprocessing
import os
import re
import subprocess
import sys
import zlib
from collections import Counter
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

from helpers.record_tables import WIRE, columns
from helpers.refusals import refused
from tactile_bayes.errors import InferenceError, RecordError, TactileBayesError
from tactile_bayes.inference.result import read_result, write_result
from tactile_bayes.record import write_record
from tactile_bayes.record.netcdf import read_netcdf, write_netcdf
from tactile_bayes.rig import Rig, make_record, read_record

SEAL = b"\ntactile_bayes: SHA-256 of all bytes before this line "
SIZE = len(SEAL) + 65


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
    write_record(make_record(columns(note=["", "a", "bc", "ß", "", "d"]), Rig(rod=WIRE), attrs={"run": 5}), record)
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


def sealed(path):
    """Give a file the last line that a file of our own has."""
    content = path.read_bytes()
    path.write_bytes(content + SEAL + hashlib.sha256(content).hexdigest().encode() + b"\n")


def external(file, other):
    count = file["force_x"].size
    del file["force_x"]
    file.create_dataset("force_x", (count,), "f8", external=[(str(other), 0, 8 * count)])


def linked(file, other):
    del file["force_x"]
    file["force_x"] = h5py.ExternalLink(str(other), "/force_x")


def link_to_nothing(file, other):
    file["note"] = h5py.ExternalLink(str(other.with_name("none.nc")), "/force_x")


def soft_link(file, other):
    file["note"] = h5py.SoftLink("/force_x")


def virtual(file, other):
    layout = h5py.VirtualLayout((6,), "f8")
    layout[:] = h5py.VirtualSource(str(other), "force_x", (6,))
    del file["force_x"]
    file.create_virtual_dataset("force_x", layout)


def in_group(file, other):
    external_to = file.create_group("more").create_group("and more")
    external_to["x"] = h5py.ExternalLink(str(other), "/force_x")


def twice(file, other):
    file["note"] = file["force_x"]


def in_itself(file, other):
    file.create_group("more")["root"] = file["/"]


def deep(file, other):
    file.create_group("/".join("a" * 40))


def plugin(file, other):
    made = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    made.set_chunk((6,))
    made.set_filter(32001, h5py.h5z.FLAG_OPTIONAL, ())
    h5py.h5d.create(file.id, b"note", h5py.h5t.NATIVE_DOUBLE, h5py.h5s.create_simple((6,)), made)


def references(file, other):
    file.create_dataset("note", data=np.array([file["force_x"].ref] * 6, dtype=h5py.ref_dtype))


def compound(file, other):
    file.create_dataset("note", data=np.zeros(6, dtype=[("a", "f8"), ("b", "i4")]))


def ragged(file, other):
    file.create_dataset("note", (6,), dtype=h5py.vlen_dtype("f8"))


def attribute_of_references(file, other):
    file["force_y"].attrs["about"] = file["force_x"].ref


def huge(file, other):
    file.create_dataset("note", (2**40,), "f8", chunks=(2**20,))


def huge_in_little(file, other):
    nothing = zlib.compress(bytes(2**23), 1)
    for number in range(40):
        note = file.create_dataset(f"note{number}", (2**22,), "f8", chunks=(2**20,), compression="gzip")
        for begin in range(0, 2**22, 2**20):
            note.id.write_direct_chunk((begin,), nothing)


def huge_text(file, other):
    file.create_dataset("note", (), dtype=f"S{2**30}")


HOSTILE = (external, linked, link_to_nothing, soft_link, virtual, in_group, twice, in_itself, deep, plugin, references,
           compound, ragged, attribute_of_references, huge, huge_in_little, huge_text)  # fmt: skip


@pytest.mark.parametrize("is_sealed", [False, True], ids=["foreign", "with checksum"])
@pytest.mark.parametrize("change", HOSTILE, ids=lambda change: change.__name__)
def test_what_leads_out_of_a_file_or_beyond_its_size_is_refused(tmp_path, change, is_sealed):
    """Before it is read: the file to which it leads has numbers that a record may have."""
    path, other = tmp_path / "record.nc", tmp_path / "other.nc"
    for each in (path, other):
        write_record(make_record(columns()), each)
    with h5py.File(path, "r+") as file:
        change(file, other)
    if is_sealed:
        sealed(path)
    with refused(RecordError, path, "is not read"):
        read_record(path)
    with refused(InferenceError, path, "is not read"):
        read_result(path)


def test_a_dimension_without_values_may_be_of_any_size(tmp_path):
    path = tmp_path / "record.nc"
    write_record(make_record(columns()), path)
    with h5py.File(path, "r+") as file:
        file.create_dataset("time", (2**40,), ">f4").make_scale(
            f"This is a netCDF dimension but not a netCDF variable.{2**40:>15}"
        )
    assert read_record(path).equals(make_record(columns()))


def everything():
    """A dataset of all that may be in one: kinds of numbers and texts, of attributes, and of packing."""
    numbers = {f"of_{kind}": ("n", np.arange(3).astype(kind)) for kind in ("i1", "u2", "i4", "u8", "f4", ">f8", ">i2")}
    more = {
        "flag": ("n", [True, False, True]),
        "word": ("n", np.array(["a", "ß€", ""], dtype=object)),
        "fixed": ("n", np.array([b"ab", b"c", b""], dtype="S2")),
        "nothing": ("empty", np.zeros(0)),
        "scalar": ((), 2.5),
        "text": ((), "words"),
        "packed": ("n", [1.5, np.nan, 3.0]),
        "cube": (("n", "m", "k"), np.arange(12.0).reshape(3, 2, 2)),
        "nan": ("n", [np.nan, -0.0, np.inf]),
    }
    attrs = {
        "text": "ß",
        "texts": ["a", "bc"],
        "one": np.int16(3),
        "many": np.array([1.5, -0.0]),
        "empty": "",
        "none": np.zeros(0),
        "bytes": b"abc",
    }
    return xr.Dataset({**numbers, **more}, {"n": ["x", "long name", "z"], "m": [0.5, 1.5]}, attrs)


def as_told(dataset):
    """All of a dataset that can be compared: names, dimensions, types, bytes, and types of attributes."""
    described = {"": (dataset.attrs, dict(dataset.sizes), list(dataset.coords))}
    for name, variable in dataset.variables.items():
        values = variable.values
        content = values.tolist() if values.dtype.kind == "O" else values.tobytes()
        described[name] = (variable.attrs, variable.dims, values.dtype, content)
    return [
        (name, [(key, type(v), np.asarray(v).dtype, np.asarray(v).tolist()) for key, v in attrs.items()], *rest)
        for name, (attrs, *rest) in described.items()
    ]


@pytest.mark.parametrize("compressed", [False, True])
def test_a_file_of_another_program_is_read_as_xarray_reads_it(tmp_path, compressed):
    path, content = tmp_path / "a.nc", everything()
    encoding = {"packed": {"dtype": "i2", "scale_factor": 0.5, "_FillValue": -1}}
    encoding |= {"cube": {"zlib": True, "shuffle": True, "chunksizes": (1, 2, 2)}} if compressed else {}
    content.attrs.pop("none")  # h5netcdf cannot write it
    content.to_netcdf(path, engine="h5netcdf", encoding=encoding)
    with xr.open_dataset(path, engine="h5netcdf") as file:
        expected = as_told(file.load())
    assert as_told(read_netcdf(path, xr.open_dataset, ValueError)) == expected
    sealed(path)
    assert as_told(read_netcdf(path, xr.open_dataset, ValueError)) == expected


def test_a_posterior_of_another_program_is_read_as_xarray_reads_it(tmp_path):
    path, tree = tmp_path / "a.nc", small_posterior()
    tree["posterior/more"] = xr.DataTree(xr.Dataset({"x": ("draw", np.arange(50.0))}))
    tree.to_netcdf(path, engine="h5netcdf")
    with xr.open_datatree(path, engine="h5netcdf") as file:
        expected = {group.path: as_told(group.to_dataset()) for group in file.load().subtree}
    found = read_result(path)
    assert {group.path: as_told(group.to_dataset()) for group in found.subtree} == expected


def test_a_file_that_was_refused_is_read_after_it_was_written_again(tmp_path):
    """In place, as programs do that know nothing of an earlier reading."""
    path = tmp_path / "record.nc"
    record = make_record(columns())
    write_record(record, path)
    whole = path.read_bytes()[:-SIZE]
    for content in (whole[:3000], whole[:-1000], b"nothing"):
        path.write_bytes(content)
        with refused(RecordError, path):
            read_record(path)
        path.write_bytes(whole)
        assert read_record(path).identical(record)
    other = make_record(columns(force_x=[0.0, -0.2, -0.4, 0.0, 0.2, 0.4]))
    write_record(other, tmp_path / "other.nc")
    path.write_bytes((tmp_path / "other.nc").read_bytes())
    assert read_record(path).identical(other)


def test_a_worker_reads_a_file_of_another_program(tmp_path, monkeypatch):
    """It is daemonic: it may start no processes of multiprocessing."""
    path, record = tmp_path / "record.nc", make_record(columns())
    record.to_netcdf(path, engine="h5netcdf")
    monkeypatch.setitem(multiprocessing.current_process()._config, "daemon", True)
    assert read_record(path).equals(record)


@pytest.mark.skipif(sys.platform != "linux", reason="no limit of memory")
@pytest.mark.parametrize("what", ["time", "memory", "crash", "start"])
def test_a_process_that_goes_wrong_over_a_file_is_a_refusal(tmp_path, monkeypatch, what):
    faults = {
        "time": "content._SECONDS = 0\ncontent._limit(0)\nwhile True: pass",
        "memory": "content._limit(1000)\nnp.ones(1 << 29)",
        "crash": "os.abort()",
        "start": "import nothing_of_this_name",
    }
    script = tmp_path / "script.py"
    script.write_text(
        "import os\nimport numpy as np\nimport tactile_bayes.record.netcdf_content as content\n" + faults[what]
    )
    monkeypatch.setattr("tactile_bayes.record.netcdf_content.__file__", str(script))
    path = tmp_path / "record.nc"
    make_record(columns()).to_netcdf(path, engine="h5netcdf")
    words = {"time": "takes more than", "memory": "MemoryError", "crash": "ends over it", "start": "nothing_of_this"}
    with pytest.raises(RecordError, match=f"^{re.escape(str(path))}: .*{words[what]}"):
        read_record(path)


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="all may be read")
def test_what_the_system_refuses_is_no_damage(tmp_path):
    write_record(make_record(columns()), tmp_path / "a.nc")
    (tmp_path / "a.nc").chmod(0)
    with pytest.raises(PermissionError):
        read_record(tmp_path / "a.nc")
