"""NetCDF files with checksums: what is damaged is refused, or read as it was."""

import hashlib
import multiprocessing
import os
import re
import sys
import zlib

import h5py
import numpy as np
import pytest
import xarray as xr

from helpers.record_tables import columns, edited
from helpers.refusals import refused
from tactile_bayes.errors import InferenceError, RecordError
from tactile_bayes.inference.result import read_result
from tactile_bayes.record import write_record
from tactile_bayes.record.netcdf import read_netcdf, write_netcdf
from tactile_bayes.rig import make_record, read_record

SEAL = b"\ntactile_bayes: SHA-256 of all bytes before this line "
SIZE = len(SEAL) + 65


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
    kinds = {"x": ("n", [1.0, 2.0]), "none": ("empty", np.zeros(0)), "one": 1.0, "word": ("n", ["a", "b"])}
    with_scalar = xr.Dataset(kinds)
    write_netcdf(with_scalar, tmp_path / "a.nc")
    write_record(make_record(columns()), tmp_path / "record.nc")
    with h5py.File(tmp_path / "a.nc") as file:
        assert [name for name in kinds if file[name].fletcher32] == ["x"]
    with h5py.File(tmp_path / "record.nc") as file:
        assert all(file[name].fletcher32 for name in make_record(columns()))
        place = file["force_x"].id.get_chunk_info(0).byte_offset
    xr.testing.assert_identical(read_netcdf(tmp_path / "a.nc", xr.open_dataset, ValueError), with_scalar)
    content = (tmp_path / "record.nc").read_bytes()
    (tmp_path / "record.nc").write_bytes(content[:place] + b"\1" + content[place + 1 : content.index(SEAL)])
    with refused(RecordError, "damaged"):
        read_record(tmp_path / "record.nc")


def test_a_file_that_another_program_writes_or_changes_is_read(tmp_path):
    """HDF5 drops the last line as it opens a file to change it; a dimension without values may be of any size."""
    write_record(make_record(columns()), tmp_path / "a.nc")
    assert (tmp_path / "a.nc").read_bytes()[-120:].count(SEAL) == 1
    with h5py.File(tmp_path / "a.nc", "r+") as file:
        file["force_y"][1] = 0.625
        file.create_dataset("time", (2**40,), ">f4").make_scale(
            f"This is a netCDF dimension but not a netCDF variable.{2**40:>15}"
        )
    assert read_record(tmp_path / "a.nc").equals(make_record(edited("force_y", 1, 0.625)))


@pytest.mark.parametrize(("name", "error"), [("record_format", RecordError), ("result_format", InferenceError)])
def test_a_file_states_its_format_and_a_newer_one_is_refused(tmp_path, name, error):
    path, record = tmp_path / "a.nc", make_record(columns())
    write_record(record, path)
    assert read_netcdf(path, xr.open_dataset, ValueError).attrs["record_format"] == 1
    assert "record_format" not in read_record(path).attrs
    write_netcdf(record.assign_attrs({name: 2}), path)
    with refused(error, path, "format 2", "format 1"):
        (read_record if error is RecordError else read_result)(path)


def sealed(path):
    """Give a file the last line that a file of our own has."""
    content = path.read_bytes()
    path.write_bytes(content + SEAL + hashlib.sha256(content).hexdigest().encode() + b"\n")


def external(file, other):
    del file["force_x"]
    file.create_dataset("force_x", (6,), "f8", external=[(str(other), 0, 48)])


def linked(file, other):
    del file["force_x"]
    file["force_x"] = h5py.ExternalLink(str(other), "/force_x")


def virtual(file, other):
    layout = h5py.VirtualLayout((6,), "f8")
    layout[:] = h5py.VirtualSource(str(other), "force_x", (6,))
    del file["force_x"]
    file.create_virtual_dataset("force_x", layout)


def plugin(file, other):
    made = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    made.set_chunk((6,))
    made.set_filter(32001, h5py.h5z.FLAG_OPTIONAL, ())
    h5py.h5d.create(file.id, b"note", h5py.h5t.NATIVE_DOUBLE, h5py.h5s.create_simple((6,)), made)


def huge_in_little(file, other):
    nothing = zlib.compress(bytes(2**23), 1)
    for number in range(40):
        note = file.create_dataset(f"note{number}", (2**22,), "f8", chunks=(2**20,), compression="gzip")
        for begin in range(0, 2**22, 2**20):
            note.id.write_direct_chunk((begin,), nothing)


def link(name, made):
    return lambda file, other: file.__setitem__(name, made(file, other))


HOSTILE = {
    "external": external,
    "linked": linked,
    "virtual": virtual,
    "plugin": plugin,
    "huge_in_little": huge_in_little,
    "link_to_nothing": link("note", lambda file, other: h5py.ExternalLink(str(other.with_name("none.nc")), "/x")),
    "soft_link": link("note", lambda file, other: h5py.SoftLink("/force_x")),
    "in_group": link("more/and more/x", lambda file, other: h5py.ExternalLink(str(other), "/force_x")),
    "twice": link("note", lambda file, other: file["force_x"]),
    "in_itself": link("more/root", lambda file, other: file["/"]),
    "deep": lambda file, other: file.create_group("/".join("a" * 40)),
    "references": lambda file, other: file.create_dataset("note", data=6 * [file["force_x"].ref], dtype=h5py.ref_dtype),
    "attribute_of_references": lambda file, other: file["force_y"].attrs.update(about=file["force_x"].ref),
    "compound": lambda file, other: file.create_dataset("note", data=np.zeros(6, dtype=[("a", "f8"), ("b", "i4")])),
    "ragged": lambda file, other: file.create_dataset("note", shape=(6,), dtype=h5py.vlen_dtype("f8")),
    "huge": lambda file, other: file.create_dataset("note", shape=(2**40,), dtype="f8", chunks=(2**20,)),
    "huge_text": lambda file, other: file.create_dataset("note", shape=(), dtype=f"S{2**30}"),
}


@pytest.mark.parametrize(("change", "is_sealed"), [*((name, True) for name in HOSTILE), ("external", False)])
def test_what_leads_out_of_a_file_or_beyond_its_size_is_refused(tmp_path, change, is_sealed):
    """Before it is read: the file to which it leads has numbers that a record may have."""
    path, other = tmp_path / "record.nc", tmp_path / "other.nc"
    for each in (path, other):
        write_record(make_record(columns()), each)
    with h5py.File(path, "r+") as file:
        HOSTILE[change](file, other)
    if is_sealed:
        sealed(path)
    with refused(RecordError, path, "is not read"):
        read_record(path)
    with refused(InferenceError, path, "is not read"):
        read_result(path)


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
    attrs = {"text": "ß", "texts": ["a", "bc"], "one": np.int16(3), "many": np.array([1.5, -0.0])}
    attrs |= {"empty": "", "bytes": b"abc"}
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
    content.to_netcdf(path, engine="h5netcdf", encoding=encoding)
    with xr.open_dataset(path, engine="h5netcdf") as file:
        expected = as_told(file.load())
    assert as_told(read_netcdf(path, xr.open_dataset, ValueError)) == expected
    sealed(path)
    assert as_told(read_netcdf(path, xr.open_dataset, ValueError)) == expected


def test_a_posterior_of_another_program_is_read_as_xarray_reads_it(tmp_path):
    path, draws = tmp_path / "a.nc", xr.Dataset({"q": (("chain", "draw"), np.ones((4, 50)), {"units": "m"})})
    stats = xr.Dataset({"r_hat": ("parameter", [1.0, 1.01]), "seconds": 3.5}, {"parameter": ["a", "quite long"]})
    root = xr.Dataset(attrs={"family": "parabola", "seed": 1, "priors": "{}", "limits": [1.0, 2.0]})
    groups = {"/": root, "posterior": draws, "posterior/more": xr.Dataset({"x": ("draw", np.arange(50.0))})}
    xr.DataTree.from_dict(groups | {"sample_stats": stats}).to_netcdf(path, engine="h5netcdf")
    with xr.open_datatree(path, engine="h5netcdf") as file:
        expected = {group.path: as_told(group.to_dataset()) for group in file.load().subtree}
    assert {group.path: as_told(group.to_dataset()) for group in read_result(path).subtree} == expected


def test_a_file_that_was_refused_is_read_after_it_was_written_again(tmp_path):
    """In place, as programs do that know nothing of an earlier reading."""
    path, record = tmp_path / "record.nc", make_record(columns())
    write_record(record, path)
    whole = path.read_bytes()[:-SIZE]
    for content in (whole[:3000], whole[:-1000], b"nothing"):
        path.write_bytes(content)
        with refused(RecordError, path):
            read_record(path)
        path.write_bytes(whole)
        assert read_record(path).identical(record)
    write_record(make_record(edited("force_x", 1, -0.2)), tmp_path / "other.nc")
    path.write_bytes((tmp_path / "other.nc").read_bytes())
    assert read_record(path).identical(make_record(edited("force_x", 1, -0.2)))


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
    imports = "import os\nimport numpy as np\nimport tactile_bayes.record.netcdf_content as content\n"
    script.write_text(imports + faults[what])
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
