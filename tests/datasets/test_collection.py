"""Data sets opened without reading them."""

import hashlib
import json
import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

import tactile_bayes as tb
from helpers.data_sets import PLAIN
from helpers.refusals import refused
from tactile_bayes.datasets import manifest as manifest_module
from tactile_bayes.datasets.manifest import read_manifest, write_manifest
from tactile_bayes.errors import SpecificationError


@pytest.fixture(scope="module")
def whole(plain_set):
    """All of it, put together by xarray from the files."""
    files = sorted(plain_set.glob("*.nc"))
    parts = [xr.load_dataset(path, engine="h5netcdf", decode_timedelta=False) for path in files]
    return xr.concat(parts, "record", data_vars="minimal", coords="minimal", compat="equals", join="exact")


def test_all_of_it_is_what_lies_in_the_files(plain_set, whole):
    xr.testing.assert_identical(tb.datasets.open(plain_set).load(), whole)
    assert whole.sizes == {"record": 24, "sweep": 2, "sample": 24}
    assert set(whole.coords) == {"record", "sweep"}


CHOSEN = {
    "last": {"record": -1},
    "step": {"record": slice(2, None, 5)},
    "backwards": {"record": slice(None, None, -3)},
    "list": {"record": [17, 2, 2, -24]},
    "nothing": {"record": []},
    "mask": {"record": np.arange(24) % 5 == 0},
    "lists of two": {"record": [1, 20], "sample": [5, 3, 5]},
    "slices of all": {"record": slice(None, None, 4), "sweep": slice(None, None, -1), "sample": slice(2, 9, 3)},
    "no record": {"sweep": [1], "sample": -1},
    "one of each kind": {"record": np.array([2, 9]), "sweep": 0, "sample": np.arange(24) > 20},
    "points": {name: xr.DataArray(at, dims="point") for name, at in (("record", [1, 9, 23]), ("sample", [0, 5, 2]))},
}
AT_ONCE = ("last", "nothing", "lists of two", "points")  # others take a second each


@pytest.mark.parametrize("name", [pytest.param(n, marks=[] if n in AT_ONCE else pytest.mark.slow) for n in CHOSEN])
def test_what_is_chosen_is_as_from_memory(plain_set, whole, name):
    data, chosen = tb.datasets.open(plain_set), CHOSEN[name]
    xr.testing.assert_identical(data.isel(chosen).load(), whole.isel(chosen))
    xr.testing.assert_identical(data.force_x.isel(chosen).load(), whole.force_x.isel(chosen))


def test_dask_reads_it_in_pieces(folder, whole):
    pytest.importorskip("dask")
    lazy = tb.datasets.open(folder).chunk(record=8)
    peak = abs(lazy.force_y).max(["sweep", "sample"])
    (folder / "shard-000001.nc").unlink()
    right = abs(whole.force_y).max(["sweep", "sample"])
    np.testing.assert_array_equal(peak[:8].compute(), right[:8])
    with refused(SpecificationError, "shard-000001.nc", "missing"):
        peak.compute()


def test_what_is_in_the_making_can_be_opened(folder, whole):
    manifest = read_manifest(folder)
    write_manifest(replace(manifest, shards=(manifest.shards[0], manifest.shards[2])), folder)
    with pytest.warns(UserWarning, match="copy has 16 of 24"):
        data = tb.datasets.open(folder)
    assert data.record.values.tolist() == [*range(8), *range(16, 24)]
    assert tb.datasets.record(folder, 17).sizes["sample"] == 48  # without a warning: this one is there
    xr.testing.assert_identical(data.sel(record=17).load(), whole.sel(record=17))
    with refused(SpecificationError, "record 9"):
        tb.datasets.record(folder, 9)
    write_manifest(replace(manifest, shards=()), folder)
    with refused(SpecificationError, folder):
        tb.datasets.open(folder)


def test_what_is_no_data_set_is_refused(plain_set, tmp_path):
    for path in (tmp_path, tmp_path / "nothing", plain_set / "README.md"):
        with refused(SpecificationError, "manifest.json"):
            tb.datasets.open(path)


def test_files_are_read_when_used_and_named_where_they_are_lost_or_damaged(folder):
    data = tb.datasets.open(folder)
    path = folder / "shard-000001.nc"
    content, before = path.read_bytes(), data.isel(record=9).load()
    damaged = bytearray(content)
    damaged[content.index(before.force_x.values.tobytes())] ^= 1
    path.write_bytes(damaged)
    (folder / "shard-000002.nc").write_bytes(b"no NetCDF")
    with refused(SpecificationError, "shard-000001.nc", "dataset verify"):
        data.isel(record=9).load()
    with refused(SpecificationError, "shard-000002.nc", "9 bytes"):
        data.isel(record=20).load()
    data.isel(record=3).load()
    path.write_bytes(content)
    assert data.isel(record=9).load().identical(before)
    path.unlink()
    with refused(SpecificationError, "shard-000001.nc", "missing"):
        data.isel(record=9).load()


def forged(folder, change):
    """Write a manifest with other entries, of its first shard if that has them, and with its own checksum right."""
    table = json.loads((folder / "manifest.json").read_text())
    table.pop("sha256")
    for name, value in change.items():
        (table["shards"][0] if name in table["shards"][0] else table)[name] = value
    (folder / "manifest.json").write_bytes(manifest_module._content(table))


FORGED = {
    "file": ["../outside.nc", "/etc/hostname", "README.md", "shard-000001.nc", "shard-000000.nc/../shard-000001.nc", 3],
    "first": [8, 0.0],
    "records": [10**12],
    "sha256": [None],
    "redrawn": [["out of reach"], {"out of reach": "often"}, {"out of reach": -1}, {"out of reach": 1}],
    "untouched": ["none", 1],
    "strained": [9],
    "name": ["circles"],
    "seed": [8],
    "shard_records": [24],
    "complete": [False],
    "specification": ["records = 24", "no TOML"],
}
READERS = (tb.datasets.open, tb.datasets.verify, lambda path: tb.datasets.record(path, 0))


def made_again(path):
    tb.datasets.generate(PLAIN, path, workers=1)


@pytest.mark.parametrize(("entry", "value"), [(entry, value) for entry in FORGED for value in FORGED[entry]], ids=str)
def test_a_manifest_lists_nothing_but_the_shards_of_its_data_set(folder, entry, value):
    shutil.copy(folder / "shard-000000.nc", folder.parent / "outside.nc")
    forged(folder, {entry: value})
    for act in (*READERS, made_again):
        with pytest.raises(SpecificationError, match=r"manifest\.json is no manifest") as error:
            act(folder)
        assert "delete" not in str(error.value)


@pytest.mark.parametrize("records", [0, 16, 25, 10**30])
def test_the_number_of_records_is_that_of_the_specification(folder, records):
    """Whether shards are missing or not, and whatever else is made to agree with it."""
    manifest = read_manifest(folder)
    for shards in (manifest.shards[:2], manifest.shards):
        write_manifest(replace(manifest, records=records, shards=shards), folder)
        for act in READERS:
            with refused(SpecificationError, "manifest.json", records):
                act(folder)


def test_the_size_of_a_file_is_that_of_the_manifest(folder):
    forged(folder, {"bytes": 7})
    for act in READERS:
        with refused(SpecificationError, "shard-000000.nc"):
            act(folder)


@pytest.mark.parametrize("name", ["shard-000000.nc", "README.md", "manifest.json"])
def test_links_out_of_the_folder_are_neither_read_nor_written(folder, name):
    outside = folder.parent / "outside"
    (folder / name).rename(outside)
    before = outside.read_bytes()
    (folder / name).symlink_to(outside)
    for act in (tb.datasets.verify, made_again, *([] if name == "README.md" else [tb.datasets.open])):
        with refused(SpecificationError, name, "link"):
            act(folder)
    assert outside.read_bytes() == before


@pytest.mark.parametrize("name", ["shard-000002.nc", "manifest.json"])
def test_no_file_is_written_through_a_link(folder, name):
    """Of a shard that is still missing, and of a manifest where nothing else is."""
    outside = folder.parent / "outside"
    manifest = read_manifest(folder)
    write_manifest(replace(manifest, shards=manifest.shards[:2], card_sha256=""), folder)
    for path in folder.iterdir() if name == "manifest.json" else [folder / name]:
        path.unlink()
    (folder / name).symlink_to(outside)
    with refused(SpecificationError, name, "link"):
        made_again(folder)
    assert not outside.exists()


def test_a_link_within_the_folder_is_read(folder, whole):
    (folder / "large").mkdir()
    (folder / "shard-000000.nc").rename(folder / "large" / "first.nc")
    (folder / "shard-000000.nc").symlink_to(Path("large") / "first.nc")
    xr.testing.assert_identical(tb.datasets.open(folder).load(), whole)


def test_variables_in_other_files_are_refused_though_the_checksum_is_right(folder, plain_set, tmp_path):
    path = folder / "shard-000001.nc"
    with h5py.File(path, "r+") as file:
        shape, size = file["force_x"].shape, 8 * file["force_x"].size
        del file["force_x"], file["force_y"]
        (tmp_path / "other").write_bytes(bytes(size))
        file.create_dataset("force_x", shape, "f8", external=[(str(tmp_path / "other"), 0, size)])
        file["force_y"] = h5py.ExternalLink(str(plain_set / path.name), "/force_y")
    content, manifest = path.read_bytes(), read_manifest(folder)
    first, shard, last = manifest.shards
    shard = shard._replace(sha256=hashlib.sha256(content).hexdigest(), bytes=len(content))
    write_manifest(replace(manifest, shards=(first, shard, last)), folder)
    data = tb.datasets.open(folder)
    data.drive_angle.load()
    for name, words in (("force_x", "another file"), ("force_y", "link")):
        with refused(SpecificationError, path.name, words):
            data[name].load()
