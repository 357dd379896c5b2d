"""Mutated specifications, manifests, attributes and results: each is read, or refused in words of our own."""

import json
import time
from collections import Counter

import numpy as np
import pytest

from helpers.data_sets import PLAIN, RICH
from tactile_bayes.datasets import read_specification
from tactile_bayes.datasets.manifest import MANIFEST, Manifest, read_manifest, write_manifest
from tactile_bayes.datasets.manifest import _content as sealed
from tactile_bayes.datasets.specification_text import toml_of
from tactile_bayes.errors import InferenceError, ParameterError, SpecificationError
from tactile_bayes.inference.ensembles.checkpoint import open_checkpoint
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.tasks import Kind, open_results_store

LIMIT = 1.0  # longest processor time of a reading [s]
SIGNS = "\"'[]{}=.,#\n\\-+0e\t\0\r_é\N{MINUS SIGN}\N{LEFT DOUBLE QUOTATION MARK}\N{ZERO WIDTH NO-BREAK SPACE}\ud800"
# Values of TOML and JSON in any place; None stands for none.
VALUES = [
    *(None, True, False, 0, -1, 1, 2**63, 10**400, 0.5, -0.0, float("nan"), float("inf"), 1e308, 5e-324),
    *("", "a", "parabola", "\0", "\ud800", "x" * 10_000, [], {}, [[]], [{}], [0.0, 0.0], [[0.0, 0.0]], ["forward"]),
    *({"uniform": [0.3, 0.8]}, {"uniform": [1]}, {"each": [1, 2]}, {"each": [1, 2], "axis": "a"}, {"choice": []}),
    *({"normal": [0, -1]}, {"log_normal": [1e308, 1e308]}, {"uniform": [-1e308, 1e308]}, {"x": {"y": {}}}),
]


def pick(rng, choices):
    return choices[int(rng.integers(len(choices)))]


def changed_text(text, rng):
    """The text with characters that are other, too many or too few, or a part that is gone, doubled or repeated."""
    for _ in range(int(rng.integers(1, 4))):
        at, end = sorted(int(place) for place in rng.integers(len(text) + 1, size=2))
        end = min(end, at + 40)
        match int(rng.integers(6)):
            case 0 | 1:
                text = text[:at] + pick(rng, SIGNS) + text[at + int(rng.integers(2)) :]
            case 2:
                text = text[:at] + text[end:]
            case 3:
                text = text[:end] + text[at:]
            case 4:
                text = text[:at] + pick(rng, ["[", "{", "[[", "a.", '"', "{a=", '{"a":', "1"]) * 30_000 + text[at:]
            case _:
                text = text[:at]
    return text


def changed_value(value, rng):
    """The value with another value, or an unknown key, in one of its places."""
    if rng.random() < 0.15 or not isinstance(value, dict | list) or not value:
        return pick(rng, VALUES)
    if isinstance(value, dict):
        if rng.random() < 0.1:
            return value | {pick(rng, ["x", "", "records", "each"]): pick(rng, VALUES)}
        key = pick(rng, list(value))
        if rng.random() < 0.1:
            return {name: one for name, one in value.items() if name != key}
        return value | {key: changed_value(value[key], rng)}
    place = int(rng.integers(len(value)))
    return [*value[:place], changed_value(value[place], rng), *value[place + 1 :]]


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


def both(found, tried):
    """Some are read and some are refused, none is lost."""
    assert found["read"] + found["refused"] == tried
    assert min(found.values()) >= 1 < len(found)


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
    both(found, 180)


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


def test_changed_manifests(tmp_path, fuzz_seed):
    rng, found = np.random.default_rng(fuzz_seed), Counter()
    write_manifest(Manifest.of(read_specification(PLAIN)), tmp_path)
    path = tmp_path / MANIFEST
    right = path.read_bytes()
    for _ in range(60):
        content = changed_text(right.decode(), rng).encode("utf-8", "surrogatepass")
        path.write_bytes(content)
        assert fate(lambda: read_manifest(tmp_path), SpecificationError) == "refused" or content == right
    table = {name: value for name, value in json.loads(right).items() if name != "sha256"}
    for _ in range(60):
        other = changed_value(table, rng)
        try:
            path.write_bytes(sealed(other if isinstance(other, dict) else {"format": other}))
        except (UnicodeEncodeError, TypeError):
            continue
        found[fate(lambda: read_manifest(tmp_path), SpecificationError)] += 1
    assert found["refused"] >= 1


def test_changed_polynomials(fuzz_seed):
    rng, found = np.random.default_rng(fuzz_seed), Counter()
    right = {"edges": [0.0, 0.5, 1.0], "coefficients": [[0.1, 0.2], [0.3, 0.4]]}
    for number in range(200):
        whole = json.dumps(right)
        text = changed_text(whole, rng) if number % 2 else json.dumps(changed_value(right, rng))
        found[fate(lambda text=text: Rod(rest_curvature=text), ParameterError)] += 1
    both(found, 200)


def test_changed_results(tmp_path, fuzz_seed):
    rng, found = np.random.default_rng(fuzz_seed), Counter()
    kind = Kind("results", InferenceError, lambda value: {"value": value}, lambda row: float(row["value"]))
    with open_results_store({"seed": "1"}, tmp_path, kind) as store:
        store.outcomes.update({number: 0.5 * number for number in range(5)})
    path = tmp_path / kind.file
    right = path.read_text(encoding="utf-8")

    def read():
        with open_results_store({"seed": "1"}, tmp_path, kind):
            pass

    for number in range(80):
        text = changed_text(right, rng) if number % 2 else json.dumps(changed_value(json.loads(right), rng))
        path.write_bytes(text.encode("utf-8", "surrogatepass"))
        found[fate(read, InferenceError)] += 1
    assert found["refused"] > 20


def test_changed_checkpoints(tmp_path, fuzz_seed):
    rng = np.random.default_rng(fuzz_seed)
    folder = tmp_path / "checkpoint"

    def read():
        with open_checkpoint(folder, {"seed": "1"}):
            pass

    read()
    right = {"kind": "ensembles of tactile-bayes", "format": 2, "steps": 0, "seconds": 0.0, "is_end": False}
    right |= {"random_states": [], "identity": {"seed": "1"}}
    for number in range(80):
        text = json.dumps(right)
        text = changed_text(text, rng) if number % 2 else json.dumps(changed_value(right, rng))
        np.savez(folder / "checkpoint.npz", description=np.array(text))
        fate(read, InferenceError)
