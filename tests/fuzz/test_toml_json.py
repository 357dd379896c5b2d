"""Mutated specifications, manifests, attributes and results: each is read, or refused in words of our own."""

import json
import time
from collections import Counter

import numpy as np
import pytest

from helpers.data_sets import PLAIN, RICH
from helpers.mutations import changed_text, changed_value, pick
from tactile_bayes.datasets import read_specification
from tactile_bayes.datasets.manifest import MANIFEST, Manifest, read_manifest, write_manifest
from tactile_bayes.datasets.specification import toml_of
from tactile_bayes.errors import InferenceError, ParameterError, SpecificationError
from tactile_bayes.inference.ensembles.checkpoint import open_checkpoint
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.tasks import Kind, open_results_store

LIMIT = 1.0  # longest processor time of a reading [s]


def fate(read, error):
    """What becomes of an input: "read", or "refused" with an error of this kind, in time."""
    began = time.thread_time()
    try:
        read()
    except error:
        return "refused"
    finally:
        assert time.thread_time() - began < LIMIT
    return "read"


@pytest.mark.parametrize("spec", [PLAIN, RICH], ids=lambda spec: spec["name"])
def test_changed_specifications(tmp_path, fuzz_seed, spec):
    rng, path, found = np.random.default_rng(fuzz_seed), tmp_path / "set.toml", Counter()
    text = toml_of(spec) + "# end\n"
    for _ in range(60):
        path.write_bytes(changed_text(text, rng).encode("utf-8", "surrogatepass"))
        found[fate(lambda: read_specification(path), SpecificationError)] += 1
    for _ in range(120):
        table = changed_value(spec, rng)
        given = table if isinstance(table, dict) else {"records": table}
        found[fate(lambda given=given: read_specification(given), SpecificationError)] += 1
    assert min(found["read"], found["refused"]) >= 1


def test_a_specification_in_another_layout_is_the_same(tmp_path, fuzz_seed):
    rng, path = np.random.default_rng(fuzz_seed), tmp_path / "set.toml"
    right = read_specification(RICH).sha256
    for _ in range(4):
        lines = toml_of(RICH).splitlines()
        order = rng.permutation(len(lines))
        end = pick(rng, ["\n", "\r\n", "\n\n", "  # why\n"])
        mark = pick(rng, ["", "\N{ZERO WIDTH NO-BREAK SPACE}"])
        path.write_bytes((mark + "".join(f"{lines[place]}{end}" for place in order)).encode())
        assert read_specification(path).sha256 == right


# --- JSON: what prepares a folder, and returns the right text and how any text is read there -------------------------


def in_file(path, read):
    """How a text in a file is read."""

    def read_text(text):
        path.write_bytes(text.encode("utf-8", "surrogatepass"))
        read()

    return read_text


def manifest(folder):
    """With its own checksum: read as it was, if at all."""
    whole = Manifest.of(read_specification(PLAIN))
    write_manifest(whole, folder)
    path = folder / MANIFEST

    def read():
        assert read_manifest(folder) == whole

    return path.read_text(encoding="utf-8"), in_file(path, read)


def results(folder):
    kind = Kind("results", InferenceError, lambda value: {"value": value}, lambda row: float(row["value"]))

    def read():
        with open_results_store({"seed": "1"}, folder, kind):
            pass

    with open_results_store({"seed": "1"}, folder, kind) as store:
        store.outcomes.update({number: 0.5 * number for number in range(5)})
    path = folder / kind.file
    return path.read_text(encoding="utf-8"), in_file(path, read)


def checkpoint(folder):
    def read(text=None):
        if text is not None:
            np.savez(folder / "checkpoint" / "checkpoint.npz", description=np.array(text))
        with open_checkpoint(folder / "checkpoint", {"seed": "1"}):
            pass

    read()
    right = {"kind": "ensembles of tactile-bayes", "format": 4, "steps": 0, "seconds": 0.0, "is_end": False}
    return json.dumps(right | {"random_states": [], "identity": {"seed": "1"}}), read


def rest_curvature(folder):
    right = {"edges": [0.0, 0.5, 1.0], "coefficients": [[0.1, 0.2], [0.3, 0.4]]}
    return json.dumps(right), lambda text: Rod(rest_curvature=text)


@pytest.mark.parametrize(
    ("prepare", "error"),
    [
        (manifest, SpecificationError),
        (results, InferenceError),
        (checkpoint, InferenceError),
        (rest_curvature, ParameterError),
    ],
)
def test_changed_json_is_read_or_refused(tmp_path, fuzz_seed, prepare, error):
    rng, found = np.random.default_rng(fuzz_seed), Counter()
    right, read = prepare(tmp_path)
    read(right)
    for number in range(120):
        text = changed_text(right, rng) if number % 2 else json.dumps(changed_value(json.loads(right), rng))
        found[fate(lambda text=text: read(text), error)] += 1
    assert found["refused"] > 20
