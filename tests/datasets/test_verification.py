"""Every kind of damage to a data set is found, and the file named."""

import json
import shutil
from dataclasses import replace

import pytest

from helpers.data_sets import PLAIN
from helpers.refusals import refused
from tactile_bayes.datasets import generate, verify
from tactile_bayes.datasets import manifest as manifest_module
from tactile_bayes.datasets.generation import generate_records
from tactile_bayes.datasets.manifest import read_manifest, write_manifest
from tactile_bayes.errors import ParameterError, SpecificationError


def test_what_is_whole_is_so(folder):
    (folder / "notes.txt").write_text("of no data set, and left alone")
    manifest = verify(folder)
    assert manifest.is_complete
    assert manifest.records == 24
    assert [shard.first for shard in manifest.shards] == [0, 8, 16]
    assert verify(str(folder), regenerate=2).shards == manifest.shards


CUTS = {"short": lambda c: c[:-1], "long": lambda c: c + b"\0", "empty": lambda c: b"", "missing": None}


@pytest.mark.parametrize("name", ["shard-000001.nc", "README.md", "manifest.json"])
@pytest.mark.parametrize("cut", CUTS)
def test_another_length_is_found(folder, name, cut):
    if cut == "missing":
        (folder / name).unlink()
    else:
        (folder / name).write_bytes(CUTS[cut]((folder / name).read_bytes()))
    with refused(SpecificationError, name):
        verify(folder)


def test_a_shard_too_many_is_found(folder):
    shutil.copy(folder / "shard-000001.nc", folder / "shard-000003.nc")
    with refused(SpecificationError, "shard-000003.nc", "manifest"):
        verify(folder)


EDITED = {
    "fewer shards": lambda table: table | {"shards": table["shards"][:2]},
    "sorted": lambda table: dict(sorted(table.items())),
    "another seed": lambda table: table | {"seed": 8},
    "without its checksum": lambda table: {name: value for name, value in table.items() if name != "sha256"},
    "a list": list,
}


@pytest.mark.parametrize("edit", [*EDITED.values(), None], ids=[*EDITED, "cut short"])
def test_an_edited_manifest_is_found_and_comes_with_a_correction(folder, edit):
    path = folder / "manifest.json"
    text = path.read_text()
    edited = text[:-30] if edit is None else json.dumps(edit(json.loads(text)), indent=1, ensure_ascii=False) + "\n"
    path.write_text(edited)
    for act in (lambda: verify(folder), lambda: generate(PLAIN, folder, workers=1)):
        with refused(SpecificationError, "manifest.json", "put a copy of it back"):
            act()


def test_progress_is_told(folder):
    told = []
    verify(folder, regenerate=2, progress=told.append)
    assert told == [(files, 5) for files in range(1, 6)]


def test_a_manifest_that_is_of_no_use_says_why(folder):
    manifest = read_manifest(folder)
    write_manifest(replace(manifest, specification_sha256="0" * 64), folder)
    with refused(SpecificationError, "manifest.json", "specification_sha256", "put a copy of it back"):
        verify(folder)
    write_manifest(replace(manifest, shards=manifest.shards[:2], card_sha256=""), folder)
    (folder / "shard-000002.nc").unlink()
    with refused(SpecificationError, "16 of 24"):
        verify(folder)
    table = json.loads((folder / "manifest.json").read_text())
    table.pop("sha256")
    (folder / "manifest.json").write_bytes(manifest_module._content(table | {"format": 99}))
    with refused(SpecificationError, "format 99"):
        verify(folder)


def test_numbers_that_come_out_otherwise_are_found(folder, monkeypatch):
    """As with another version of a library: the bytes are those of the manifest, the numbers are not made again."""

    def otherwise(spec, begin, end):
        records = generate_records(spec, begin, end)
        records.sample["truth_force_x"][-1, 0, 5] += 1e-12
        return records

    monkeypatch.setattr("tactile_bayes.datasets.verification.generate_records", otherwise)
    verify(folder)
    with pytest.raises(SpecificationError, match=r"shard-000000\.nc: truth_force_x .* numpy \d"):
        verify(folder, regenerate=1)


@pytest.mark.parametrize("change", [{"strained": 1}, {"untouched": 3}, {"redrawn": {"out of reach": 2}}], ids=str)
def test_counts_that_come_out_otherwise_are_found(folder, change):
    """Each is possible, and only another generation knows better."""
    manifest = read_manifest(folder)
    shards = (manifest.shards[0]._replace(**change), *manifest.shards[1:])
    write_manifest(replace(manifest, shards=shards), folder)
    verify(folder)
    with refused(SpecificationError, "shard-000000.nc", *change):
        verify(folder, regenerate=1)


@pytest.mark.parametrize("count", [-1, 1.5, "all"])
def test_no_number_of_shards_is_refused(folder, count):
    with refused(ParameterError, regenerate=count):
        verify(folder, regenerate=count)


@pytest.mark.parametrize("name", ["shard-000001.nc", "README.md"])
def test_what_is_damaged_is_mended_as_the_refusal_says(folder, plain_set, name):
    (folder / name).write_bytes(b"damaged")
    with refused(SpecificationError, name, "delete it"):
        verify(folder)
    (folder / name).unlink()
    generate(PLAIN, folder, workers=1)
    verify(folder)
    assert (folder / name).read_bytes() == (plain_set / name).read_bytes()
