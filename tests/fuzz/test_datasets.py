"""Data sets with damaged and forged files: verify names the damaged one, and none is read but as it was."""

import json
import shutil

import numpy as np
import pytest

import tactile_bayes as tb
from helpers.data_sets import PLAIN, changed
from helpers.mutations import changed_bytes, changed_value, pick
from helpers.refusals import refused
from tactile_bayes.datasets.manifest import MANIFEST
from tactile_bayes.datasets.manifest import _content as sealed
from tactile_bayes.errors import SpecificationError

CASES = 5


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    folder = tmp_path_factory.mktemp("original")
    tb.datasets.generate(changed(PLAIN, records=4, shard_records=2, scan__samples=5), folder, workers=1)
    return folder, tb.datasets.open(folder).load()


@pytest.fixture
def folder(original, tmp_path):
    return shutil.copytree(original[0], tmp_path / "copy")


def test_a_damaged_file_is_named_and_not_read(folder, original, fuzz_seed):
    rng = np.random.default_rng(fuzz_seed)
    files = sorted(path for path in folder.iterdir() if path.is_file())
    for _ in range(CASES):
        path = pick(rng, files)
        content = path.read_bytes()
        path.write_bytes(changed_bytes(content, rng))
        if path.read_bytes() != content:
            with refused(SpecificationError, path):
                tb.datasets.verify(folder)
            if path.name != "README.md":
                with refused(SpecificationError, path):
                    tb.datasets.open(folder).force_x.load()
        path.write_bytes(content)
    assert tb.datasets.open(folder).load().identical(original[1])


def test_a_forged_manifest_leads_nowhere(folder, original, fuzz_seed):
    """Its own checksum is right. What it states beside its files may be anything of the same kind."""
    rng, path, ended = np.random.default_rng(fuzz_seed), folder / MANIFEST, {"refused": 0, "read": 0}
    whole = json.loads(path.read_text(encoding="utf-8"))
    whole.pop("sha256")
    for _ in range(3 * CASES):
        forged = changed_value(whole, rng)
        try:
            path.write_bytes(sealed(forged if isinstance(forged, dict) else {"format": forged}))
        except (UnicodeEncodeError, TypeError):
            continue
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
