"""Data sets opened without reading them."""

import dataclasses
import hashlib
import json
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

import tactile_bayes as tb
from helpers.data_sets import PLAIN, RICH, changed
from helpers.refusals import refused
from tactile_bayes.datasets import collection
from tactile_bayes.datasets import manifest as manifest_module
from tactile_bayes.datasets.collection import read_shard
from tactile_bayes.datasets.manifest import read_manifest, write_manifest
from tactile_bayes.datasets.netcdf import netcdf_of
from tactile_bayes.errors import SpecificationError


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("plain set")
    tb.datasets.generate(PLAIN, path, workers=1)
    return path


@pytest.fixture(scope="module")
def whole(folder):
    """All of it, put together by xarray from the files."""
    parts = [xr.load_dataset(path, engine="h5netcdf", decode_timedelta=False) for path in sorted(folder.glob("*.nc"))]
    return xr.concat(parts, "record", data_vars="minimal", coords="minimal", compat="equals", join="exact")


@pytest.fixture
def files_read(monkeypatch):
    """Names of the files that were compared with the manifest, from which numbers are then read."""
    names, real = [], collection._unchanged

    def noted(folder, shard):
        names.append(shard.file)
        return real(folder, shard)

    monkeypatch.setattr(collection, "_unchanged", noted)
    return names


def test_all_of_it_is_what_lies_in_the_files(folder, whole):
    xr.testing.assert_identical(tb.datasets.open(folder).load(), whole)
    assert whole.sizes == {"record": 24, "sweep": 2, "sample": 24}
    assert set(whole.coords) == {"record", "sweep"}


def test_nothing_is_read_before_it_is_used(folder, files_read):
    data = tb.datasets.open(folder)
    assert files_read == ["shard-000000.nc"]  # what variables there are
    some = data.isel(record=slice(9, 12))[["force_x"]]
    some = some.sel(sweep=1)
    assert files_read == ["shard-000000.nc"]
    some.load()
    assert files_read == ["shard-000000.nc", "shard-000001.nc"]
    some.load()
    assert len(files_read) == 2


INDEXERS = {
    "int": 5,
    "last": -1,
    "slice": slice(3, 20),
    "step": slice(2, None, 5),
    "backwards": slice(None, None, -3),
    "list": [17, 2, 2, 9],
    "negative list": [-1, 0, -24],
    "nothing": [],
    "empty slice": slice(4, 4),
    "array": np.array([23, 0, 11]),
    "mask": np.arange(24) % 5 == 0,
}
OF_A_KIND = ("int", "slice", "list", "empty slice", "array")  # others stand for these


@pytest.mark.parametrize(
    "key",
    [pytest.param(key, id=name, marks=pytest.mark.slow if name in OF_A_KIND else []) for name, key in INDEXERS.items()],
)
def test_records_are_chosen_as_from_memory(folder, whole, key):
    data = tb.datasets.open(folder)
    xr.testing.assert_identical(data.isel(record=key).load(), whole.isel(record=key))
    xr.testing.assert_identical(data.force_x.isel(record=key).load(), whole.force_x.isel(record=key))


@pytest.mark.parametrize(
    "chosen",
    [
        pytest.param({"record": 3, "sweep": 1, "sample": 7}, marks=pytest.mark.slow),
        {"record": [1, 20], "sample": [5, 3, 5]},
        {"record": slice(None, None, 4), "sweep": slice(None, None, -1), "sample": slice(2, 9, 3)},
        {"sample": -1},
        pytest.param({"sweep": [1]}, marks=pytest.mark.slow),
        {"record": [2, 9], "sweep": 0, "sample": np.arange(24) > 20},
    ],
)
def test_axes_are_chosen_together(folder, whole, chosen):
    xr.testing.assert_identical(tb.datasets.open(folder).isel(chosen).load(), whole.isel(chosen))


def test_points_are_chosen(folder, whole):
    pointwise = {"record": xr.DataArray([1, 9, 23], dims="point"), "sample": xr.DataArray([0, 5, 2], dims="point")}
    xr.testing.assert_identical(tb.datasets.open(folder).isel(pointwise).load(), whole.isel(pointwise))


def test_labels_and_groups(folder, whole):
    data = tb.datasets.open(folder)
    xr.testing.assert_identical(data.sel(record=[3, 17]).load(), whole.sel(record=[3, 17]))
    high = data.truth_contour_q > 0.5
    xr.testing.assert_identical(data.isel(record=high.values).load(), whole.isel(record=high.values))
    means = data[["force_y"]].groupby(high.rename("high").load()).mean()
    np.testing.assert_allclose(means.force_y.sel(high=True), whole.force_y[high.values].mean("record"))
    np.testing.assert_array_equal(data.force_x.max("sample"), whole.force_x.max("sample"))


def test_dask_reads_it_in_pieces(folder, whole, files_read):
    pytest.importorskip("dask")
    lazy = tb.datasets.open(folder).chunk(record=8)
    before = len(files_read)
    peak = abs(lazy.force_y).max(["sweep", "sample"])
    assert len(files_read) == before
    np.testing.assert_array_equal(peak.compute(), abs(whole.force_y).max(["sweep", "sample"]))


def test_what_is_in_the_making_can_be_opened(folder, whole, tmp_path):
    some = tmp_path / "half"
    shutil.copytree(folder, some)
    manifest = read_manifest(some)
    write_manifest(type(manifest)(**{**vars(manifest), "shards": (manifest.shards[0], manifest.shards[2])}), some)
    with pytest.warns(UserWarning, match="half has 16 of 24"):
        data = tb.datasets.open(some)
    assert data.record.values.tolist() == [*range(8), *range(16, 24)]
    assert tb.datasets.record(some, 17).sizes["sample"] == 48  # without a warning: this one is there
    xr.testing.assert_identical(data.sel(record=17).load(), whole.sel(record=17))
    with refused(SpecificationError, "record 9"):
        tb.datasets.record(some, 9)
    write_manifest(type(manifest)(**{**vars(manifest), "shards": ()}), some)
    with refused(SpecificationError, some):
        tb.datasets.open(some)


def test_what_is_no_data_set_is_refused(folder, tmp_path):
    for path in (tmp_path, tmp_path / "nothing", folder / "README.md"):
        with refused(SpecificationError, "manifest.json"):
            tb.datasets.open(path)


def test_files_that_are_lost_or_damaged_are_named(folder, tmp_path):
    some = tmp_path / "some"
    shutil.copytree(folder, some)
    data = tb.datasets.open(some)
    (some / "shard-000001.nc").unlink()
    with refused(SpecificationError, "shard-000001.nc", "missing"):
        data.isel(record=9).load()
    (some / "shard-000002.nc").write_bytes(b"no NetCDF")
    with refused(SpecificationError, "shard-000002.nc", "9 bytes"):
        data.isel(record=20).load()
    data.isel(record=3).load()


def test_a_changed_number_is_refused_and_a_file_put_back_is_read(folder, tmp_path):
    some = tmp_path / "some"
    shutil.copytree(folder, some)
    path, data = some / "shard-000001.nc", tb.datasets.open(some)
    content, before = path.read_bytes(), data.isel(record=9).load()
    damaged = bytearray(content)
    damaged[content.index(before.force_x.values.tobytes())] ^= 1
    path.write_bytes(damaged)
    with refused(SpecificationError, "shard-000001.nc", "dataset verify"):
        data.isel(record=9).load()
    path.write_bytes(content)
    assert data.isel(record=9).load().identical(before)


def forged(folder, change):
    """Write a manifest with other entries, of its first shard if that has them, and with its own checksum right."""
    table = json.loads((folder / "manifest.json").read_text())
    table.pop("sha256")
    for name, value in change.items():
        (table["shards"][0] if name in table["shards"][0] else table)[name] = value
    (folder / "manifest.json").write_bytes(manifest_module._content(table))


@pytest.mark.parametrize(
    "change",
    [
        {"file": "../outside.nc"},
        {"file": "/etc/hostname"},
        {"file": "README.md"},
        {"file": "shard-000001.nc"},
        {"file": "shard-000000.nc/../shard-000001.nc"},
        {"file": 3},
        {"first": 8},
        {"first": 0.0},
        {"records": 10**12},
        {"sha256": None},
        {"redrawn": ["out of reach"]},
        {"redrawn": {"out of reach": "often"}},
        {"redrawn": {"out of reach": -1}},
        {"redrawn": {"out of reach": 1}},
        {"untouched": "none"},
        {"untouched": 1},
        {"strained": 9},
        {"name": "circles"},
        {"seed": 8},
        {"shard_records": 24},
        {"complete": False},
        {"specification": "records = 24"},
        {"specification": "no TOML"},
    ],
    ids=str,
)
def test_a_manifest_lists_nothing_but_the_shards_of_its_data_set(folder, tmp_path, change):
    some = tmp_path / "some"
    shutil.copytree(folder, some)
    shutil.copy(some / "shard-000000.nc", tmp_path / "outside.nc")
    forged(some, change)
    acts = (tb.datasets.open, tb.datasets.verify, lambda path: tb.datasets.generate(PLAIN, path, workers=1))
    for act in (*acts, lambda path: tb.datasets.record(path, 0)):
        with pytest.raises(SpecificationError, match=r"manifest\.json is no manifest") as error:
            act(some)
        assert "delete" not in str(error.value)


@pytest.mark.parametrize("records", [0, 16, 25, 10**30])
def test_the_number_of_records_is_that_of_the_specification(folder, tmp_path, records):
    """Whether shards are missing or not, and whatever else is made to agree with it."""
    some = tmp_path / "some"
    shutil.copytree(folder, some)
    manifest = read_manifest(some)
    for shards in (manifest.shards[:2], manifest.shards):
        write_manifest(dataclasses.replace(manifest, records=records, shards=shards), some)
        for act in (tb.datasets.open, tb.datasets.verify, lambda path: tb.datasets.record(path, 0)):
            with refused(SpecificationError, "manifest.json", records):
                act(some)


def test_the_size_of_a_file_is_that_of_the_manifest(folder, tmp_path):
    some = tmp_path / "some"
    shutil.copytree(folder, some)
    forged(some, {"bytes": 7})
    for act in (tb.datasets.open, tb.datasets.verify):
        with refused(SpecificationError, "shard-000000.nc"):
            act(some)


@pytest.mark.parametrize("name", ["shard-000000.nc", "README.md", "manifest.json"])
def test_links_out_of_the_folder_are_neither_read_nor_written(folder, tmp_path, name):
    some, outside = tmp_path / "some", tmp_path / "outside"
    shutil.copytree(folder, some)
    (some / name).rename(outside)
    before = outside.read_bytes()
    (some / name).symlink_to(outside)
    for act in (tb.datasets.verify, lambda path: tb.datasets.generate(PLAIN, path, workers=1)):
        with refused(SpecificationError, name, "link"):
            act(some)
    if name != "README.md":
        with refused(SpecificationError, name, "link"):
            tb.datasets.open(some)
    assert outside.read_bytes() == before


def test_no_file_is_written_through_a_link(folder, tmp_path):
    """Of a shard that is still missing, and of a manifest."""
    some, outside = tmp_path / "some", tmp_path / "outside"
    shutil.copytree(folder, some)
    manifest = read_manifest(some)
    write_manifest(dataclasses.replace(manifest, shards=manifest.shards[:2], card_sha256=""), some)
    for name in ("shard-000002.nc", "manifest.json"):
        (some / name).unlink()
        (some / name).symlink_to(outside)
        with refused(SpecificationError, name, "link"):
            tb.datasets.generate(PLAIN, some, workers=1)
        assert not outside.exists()
        for path in some.glob("shard-*.nc"):
            path.unlink()
        (some / "README.md").unlink(missing_ok=True)


def test_a_link_within_the_folder_is_read(folder, tmp_path):
    some = tmp_path / "some"
    shutil.copytree(folder, some)
    (some / "large").mkdir()
    (some / "shard-000000.nc").rename(some / "large" / "first.nc")
    (some / "shard-000000.nc").symlink_to(Path("large") / "first.nc")
    assert tb.datasets.open(some).load().identical(tb.datasets.open(folder).load())


def test_variables_in_other_files_are_refused_though_the_checksum_is_right(folder, tmp_path):
    some, number = tmp_path / "some", 1
    shutil.copytree(folder, some)
    path = some / f"shard-{number:06d}.nc"
    with h5py.File(path, "r+") as file:
        shape, size = file["force_x"].shape, 8 * file["force_x"].size
        del file["force_x"], file["force_y"]
        (tmp_path / "other").write_bytes(bytes(size))
        file.create_dataset("force_x", shape, "f8", external=[(str(tmp_path / "other"), 0, size)])
        file["force_y"] = h5py.ExternalLink(str(folder / path.name), "/force_y")
    data = tb.datasets.open(folder)
    content = path.read_bytes()
    shard = read_manifest(some).shards[number]
    mine = shard._replace(sha256=hashlib.sha256(content).hexdigest(), bytes=len(content))
    shards = tuple(mine if other == shard else other for other in read_manifest(some).shards)
    write_manifest(dataclasses.replace(read_manifest(some), shards=shards), some)
    data = tb.datasets.open(some)
    data.drive_angle.load()
    for name, words in (("force_x", "another file"), ("force_y", "link")):
        with refused(SpecificationError, path.name, words):
            data[name].load()


@pytest.mark.slow
@pytest.mark.parametrize("spec", [PLAIN, RICH, changed(PLAIN, contours=[
    {"family": "shape-free", "r": 0.8, "amplitude": 0.1, "length_scale": 1.5, "q": 0.5}])])  # fmt: skip
def test_files_are_as_xarray_would_write_them(spec, tmp_path):
    """Up to the order in which HDF5 lists them: read back, both are the same, in every name, number and attribute."""
    tb.datasets.generate(changed(spec, records=3, shard_records=3), tmp_path, workers=1)
    (shard,) = read_manifest(tmp_path).shards
    mine = read_shard(tmp_path, shard)
    encoding = {name: {"_FillValue": None} for name in mine.variables}
    mine.to_netcdf(tmp_path / "theirs.nc", engine="h5netcdf", encoding=encoding)
    theirs = xr.load_dataset(tmp_path / "theirs.nc", engine="h5netcdf", decode_times=False, decode_timedelta=False)
    xr.testing.assert_identical(mine, theirs)
    assert {n: v.dtype for n, v in mine.variables.items()} == {n: v.dtype for n, v in theirs.variables.items()}
    assert netcdf_of(mine) == netcdf_of(mine.copy(deep=True))
