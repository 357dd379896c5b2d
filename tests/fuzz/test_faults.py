"""Every writer under faults of the system: nothing is lost, nothing is half, and a rerun makes up for it.

Each call that changes files fails once (no space, a fault of the disk, no right), or the process is killed there.
After an error the files are the old ones or the new ones, and no temporary file is left; after a kill old and new
files are never side by side, and without the first of its names a folder shows that it is not complete.
"""

import os
import shutil
import sys
import types
import zipfile
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from scipy import stats

from helpers.data_sets import PLAIN, changed
from helpers.faults import ERRORS, KILL, faulty, killed
from tactile_bayes import datasets
from tactile_bayes.cli.app import _message
from tactile_bayes.contours import Parabola
from tactile_bayes.datasets import shard
from tactile_bayes.diagnostics import Check
from tactile_bayes.diagnostics.findings import Finding
from tactile_bayes.diagnostics.inspection import inspect_record
from tactile_bayes.errors import InferenceError, TactileBayesError
from tactile_bayes.inference.coordinates import Coordinates
from tactile_bayes.inference.ensembles.checkpoint import open_checkpoint
from tactile_bayes.inference.ensembles.run_state import Block, RunState
from tactile_bayes.inference.ensembles.walkers import first_random_state
from tactile_bayes.inference.result import write_result
from tactile_bayes.inference.streams.stream import Stream
from tactile_bayes.record import write_record
from tactile_bayes.report import writing
from tactile_bayes.rig import Rig, make_record
from tactile_bayes.rig.rig_prior import RigPrior
from tactile_bayes.runs import contour, names, readings, rig, verdicts
from tactile_bayes.runs.folder import Folder
from tactile_bayes.tasks import Kind, is_temporary, open_results_store

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="calls are counted as Linux makes them")

PARTS = 5  # number of faults that each writer meets in a fast run; a slow one tries others


def data(k):
    """A small dataset of one of two generations, for whoever writes one."""
    attrs = {"verdict": f"{k}", "words": f"words {k}", "summary": f"summary {k}", "message": f"message {k}"}
    return xr.Dataset({"x": ("family", [1.0 + k, 2.0])}, {"family": ["one", "other"]}, attrs)


def tree(k):
    draws = xr.Dataset({"q": (("chain", "draw"), np.full((2, 3), 0.5 + k))})
    return xr.DataTree.from_dict({"/": xr.Dataset(attrs=data(k).attrs), "posterior": draws})


def record(k):
    forces = {"force_x": [0.1, k], "force_y": [0.2, 0.0]}
    columns = {"sweep": 0, "direction": "forward", "drive_angle": [1.2, 1.3], **forces}
    return make_record(columns, Rig(file={"missing": ("holding_moment",)}))


def returned(make):
    """A function that returns what belongs to the generation that is written, whatever it is asked."""
    return lambda *arguments, **options: make(GENERATION[0])


GENERATION = [0]  # generation that is written, for functions that stand for those of the library


@pytest.fixture(autouse=True)
def cheap(monkeypatch):
    """No computation, no figures and no waiting for a disk: what is written is data of a generation."""
    monkeypatch.setattr(os, "fsync", lambda handle: None)

    def draw(self, what, name, *arguments, **options):
        with self.file(what, name) as path:
            path.write_bytes(f"picture {GENERATION[0]}".encode())

    def draw_some(figures, folder):
        for name in (("trace", "pairs"), ("trace", "gap"))[GENERATION[0]]:
            folder.draw(name, f"{name}.png", None)

    monkeypatch.setattr(Folder, "draw", draw)
    monkeypatch.setattr(contour, "_draw", draw_some)
    monkeypatch.setattr(contour, "contact_points", returned(lambda k: None if k else data(k)))
    for module, name, make in (
        (contour, "contour_band", data),
        (contour, "reach", data),
        (contour, "gap_if_any", lambda k: None),
        (contour, "check", lambda k: Check((Finding("reservation", summary=f"message {k}"),), False, None)),
        (contour, "summary", data),
        (rig, "calibrate_rig", lambda k: Rig(calibration=replace(CALIBRATION, posterior=tree(k)))),
        (rig, "check", lambda k: Check((Finding("reservation", summary=f"message {k}"),), False, None)),
        (rig, "summary", data),
        (writing, "findings_of", lambda k: None),
        (writing, "page_of", lambda k: {"data": {}}),
        (writing, "rendered", lambda k: f"page {k}"),
        (shard, "netcdf_of", lambda k: [memoryview(b"numbers" * 100)]),
        (shard, "records_as_dataset", data),
        (shard, "generate_records", lambda k: GENERATED),
    ):
        monkeypatch.setattr(module, name, returned(make))


CALIBRATION = RigPrior({"lever_x": stats.norm(0.0, 0.1)}, np.eye(1), 0.01, "0")
COUNTS = {"redrawn": {}, "strained": 0, "untouched": 0}
GENERATED = types.SimpleNamespace(index=np.arange(2), counts=COUNTS)
STORED = Kind("numbers", InferenceError, lambda value: {"value": value}, lambda row: row["value"])
STATE = first_random_state(np.random.SeedSequence(1))
SPEC = changed(PLAIN, records=4, shard_records=2)


def write_states(folder, k):
    """The state of a run after four steps, and in the next generation after eight."""
    start = Block(np.zeros((1, 1, 2, 3)), np.zeros((1, 1, 2)), (STATE,))
    with open_checkpoint(folder, {"a": "b"}) as checkpoint:
        state = checkpoint.read(Coordinates(), (1, 2, 3)) if checkpoint.exists else RunState.begin(Coordinates(), start)
        while state.steps < 4 * (k + 1):
            state = state.append(Block(np.full((1, 4, 2, 3), state.steps), np.zeros((1, 4, 2)), (STATE,)))
            checkpoint.write(state, 1.0, is_end=True)


def write_outcomes(folder, k):
    with open_results_store({"a": "b"}, folder, STORED) as store:
        for number in range(k + 1):
            store.outcomes[number] = 0.5 + number
            store.write()


def write_report(folder, k):
    run = folder / "run"
    if k == 0:
        run.mkdir(exist_ok=True)
        (run / "posterior.nc").write_text("a posterior")
    writing.write_report(run)


def write_run(folder, k):
    run = contour.RunFolder(folder)
    run.write_posterior(tree(k))
    contour.complete(run, record(k), Rig(), tree(k), 0.95)


WRITERS = {
    "record.csv": lambda folder, k: write_record(record(k), folder / "record.csv"),
    "record.nc": lambda folder, k: write_record(record(k), folder / "record.nc"),
    "posterior": lambda folder, k: write_result(tree(k), folder / "posterior.nc"),
    "stream": lambda folder, k: Stream.save(types.SimpleNamespace(as_tree=lambda: tree(k)), folder / "stream.nc"),
    "report": write_report,
    "outcomes": write_outcomes,
    "checkpoint": write_states,
    "data set": lambda folder, k: datasets.generate(SPEC, folder, workers=1) if k else None,
    "infer": write_run,
    "inspect": lambda folder, k: readings.write_inspection(INSPECTIONS[k], folder, rig=Rig()),
    "compare": lambda folder, k: verdicts.write_comparison(data(k), folder),
    "calibrate-rig": lambda folder, k: rig.calibrate_rig_into(
        folder, [(None, None)], contour=Parabola(0.5, 0.5), rig=Rig()
    ),
}

# Writers of folders of files that belong together, with the file that shows that all of them are there. All commands
# write them through `Folder`: `compare` stands for those that do nothing else.
FIRST = {
    "infer": names.INFERENCE[0],
    "inspect": names.INSPECTION[0],
    "compare": names.COMPARISON[0],
    "calibrate-rig": names.RIG[0],
}
# Files that grow, and of which a later step is the next state.
GROWING = {("outcomes", "numbers.json"), ("data set", "manifest.json")}
INSPECTIONS = [inspect_record(record(k)) for k in (0, 1)]


def state(folder):
    """The files in a folder by name, as far as they are to be the same each time."""
    found = {}
    for path in folder.rglob("*"):
        if path.is_file() and not any(is_temporary(part) for part in path.relative_to(folder).parents):
            name = str(path.relative_to(folder))
            found[name] = path.read_bytes()
            if path.suffix == ".npz":  # the archive also holds the time
                with zipfile.ZipFile(path) as archive:
                    found[name] = {part: archive.read(part) for part in archive.namelist()}
    return found


def written(name, folder, k):
    GENERATION[0] = k
    WRITERS[name](folder, k)


@pytest.fixture(params=WRITERS)
def writer(request, tmp_path):
    """Its name, a folder of the former generation, and the states before and after."""
    former, after = tmp_path / "former", tmp_path / "after"
    former.mkdir()
    if request.param != "checkpoint":  # whose folder it has for itself
        (former / "notes.txt").write_text("mine")
    written(request.param, former, 0)
    shutil.copytree(former, after)
    with faulty() as faults:
        written(request.param, after, 1)
    assert faults.calls
    return request.param, former, state(former), state(after), len(faults.calls)


def test_nothing_is_lost_and_nothing_is_half(writer, fuzz_seed, tmp_path):
    name, former, old, new, calls = writer
    rng = np.random.default_rng(fuzz_seed)
    for number in rng.permutation(calls)[:PARTS].tolist():
        number, fault = number + 1, (*ERRORS, KILL)[rng.integers(4)]
        folder = tmp_path / f"{number} {fault}"
        shutil.copytree(former, folder)
        if fault == KILL:
            assert killed(number, written, name, folder, 1)
            assert_recognised(name, state(folder), old, new)
        else:
            with faulty(number, fault) as faults:
                error = error_of(name, folder)
            where = (name, number, fault, faults.calls[:number][-9:])
            assert not left_over(folder), where
            if error is None:
                assert_made(state(folder), new, folder, where)
            else:
                assert_named(error, folder, where)
                assert_whole(name, state(folder), old, new, where)
        had_all = state(folder) == new
        written(name, folder, 1)
        assert state(folder) == new, (name, number, fault)
        assert had_all or not left_over(folder), (name, number, fault)  # with nothing to write, nothing is cleaned


def error_of(name, folder):
    try:
        written(name, folder, 1)
    except (OSError, TactileBayesError) as error:
        return error
    return None


def left_over(folder):
    return [path for path in folder.rglob("*") if is_temporary(path)]


def assert_made(found, new, folder, where):
    """Everything is there, except a part that the summary of a run says to be left out, and why."""
    said = found.get("summary.txt", b"").decode().splitlines()
    left_out = [line for line in said if line.startswith("Left out: ")]
    if left_out:
        assert f" {folder}{os.sep}" in left_out[0], (left_out, where)
        assert len(set(new) - set(found)) == 1, where
    else:
        assert found == new, where


def assert_named(error, folder, where):
    """The command line makes a message of it that says where, and no traceback."""
    message, code = _message(error)
    assert code == 2, where
    assert str(folder) in message, (message, where)


def assert_whole(name, found, old, new, where):
    """Files that belong together are all old or all new, or the posterior is new and alone; any other is old or new."""
    if name in FIRST:
        alone = {path: new.get(path) for path in ("posterior.nc", "notes.txt")}
        assert found in ([old, new, alone] if name == "infer" else [old, new]), (sorted(found), where)
        return
    for path in {*old, *new, *found}:
        assert found.get(path) in (old.get(path), new.get(path)) or (name, path) in GROWING, (path, where)


def assert_recognised(name, found, old, new):
    """After a kill: never old beside new, and without the first name where not all is there."""
    for path, content in found.items():
        assert content in (old.get(path), new.get(path)) or (name, path) in GROWING, path
    assert found.get("notes.txt") == old.get("notes.txt")
    if name in FIRST and found not in (old, new):
        assert FIRST[name] not in found
        ours = {path: content for path, content in found.items() if old.get(path) != new.get(path)}
        assert any(
            all(content == generation.get(path) for path, content in ours.items()) for generation in (old, new)
        ), sorted(ours)
