"""Data sets with damaged and forged files: verify names the damaged one, and none is read but as it was."""

import copy
import json
import shutil

import numpy as np
import pytest

import tactile_bayes as tb
from helpers.data_sets import PLAIN, changed
from helpers.refusals import refused
from tactile_bayes.datasets import manifest as manifest_module
from tactile_bayes.errors import SpecificationError

CASES = 5

JUNK = (
    None,
    True,
    -1,
    0,
    1.5,
    10**30,
    float("nan"),
    "",
    "../outside.nc",
    "/etc/hostname",
    "\0",
    "ß" * 1000,
    [],
    {},
    [[]],
)


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    folder = tmp_path_factory.mktemp("original")
    tb.datasets.generate(changed(PLAIN, records=4, shard_records=2, scan__samples=5), folder, workers=1)
    return folder, tb.datasets.open(folder).load()


@pytest.fixture
def folder(original, tmp_path):
    return shutil.copytree(original[0], tmp_path / "copy")


def damaged(content, rng):
    at, size = int(rng.integers(len(content))), int(2 ** rng.uniform(0, 8))
    match int(rng.integers(4)):
        case 0:
            return content[:at] + bytes([content[at] ^ 1 << int(rng.integers(8))]) + content[at + 1 :]
        case 1:
            return content[:at] + rng.bytes(size) + content[at + size :]
        case 2:
            return content[:at] + content[at + size :]
        case _:
            return content[:at]


def test_a_damaged_file_is_named_and_not_read(folder, original, fuzz_seed):
    rng = np.random.default_rng(fuzz_seed)
    files = sorted(path for path in folder.iterdir() if path.is_file())
    for _ in range(CASES):
        path = files[int(rng.integers(len(files)))]
        content = path.read_bytes()
        path.write_bytes(damaged(content, rng))
        if path.read_bytes() != content:
            with refused(SpecificationError, path):
                tb.datasets.verify(folder)
            if path.name != "README.md":
                with refused(SpecificationError, path):
                    tb.datasets.open(folder).force_x.load()
        path.write_bytes(content)
    assert tb.datasets.open(folder).load().identical(original[1])


def places_in(table, place=()):
    """Yield the keys that lead to each entry of nested tables and lists."""
    for key, part in table.items() if isinstance(table, dict) else enumerate(table):
        yield (*place, key)
        if isinstance(part, dict | list):
            yield from places_in(part, (*place, key))


def test_a_forged_manifest_leads_nowhere(folder, original, fuzz_seed):
    """Its own checksum is right. What it states beside its files may be anything of the same kind."""
    rng, path = np.random.default_rng(fuzz_seed), folder / "manifest.json"
    whole, ended = json.loads(path.read_text(encoding="utf-8")), {"refused": 0, "read": 0}
    whole.pop("sha256")
    places = list(places_in(whole))
    for _ in range(3 * CASES):
        table = forged = copy.deepcopy(whole)
        *way, last = places[int(rng.integers(len(places)))]
        for key in way:
            table = table[key]
        table[last] = JUNK[int(rng.integers(len(JUNK)))]
        path.write_bytes(manifest_module._content(forged))
        for act in (tb.datasets.verify, lambda of: tb.datasets.record(of, 3)):
            try:
                act(folder)
            except SpecificationError:
                ended["refused"] += 1
        try:
            assert tb.datasets.open(folder).force_x.load().identical(original[1].force_x)
            ended["read"] += 1
        except SpecificationError:
            ended["refused"] += 1
    assert ended["refused"] > CASES
