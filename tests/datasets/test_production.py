"""Data sets in the making: the same whoever makes them, and whatever befalls those who do."""

import hashlib
import json
import random
import signal
import subprocess
import sys
import time
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import pytest

from helpers.data_sets import PLAIN, RICH, changed, hashes
from helpers.refusals import refused
from helpers.tasks import alive, wait_until
from tactile_bayes.datasets import generate, verify
from tactile_bayes.datasets.manifest import read_manifest, write_manifest
from tactile_bayes.datasets.specification import toml_of
from tactile_bayes.errors import SpecificationError
from tactile_bayes.tasks import Workers, alone_in

TESTS = Path(__file__).resolve().parents[1]
on_linux = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks processes up in /proc")

MANY = changed(PLAIN, records=120, shard_records=4)  # thirty shards, each of some ten milliseconds
GENERATE = "import sys; from tactile_bayes.datasets import generate; generate(*sys.argv[1:3], workers=int(sys.argv[3]))"


@pytest.fixture(scope="module")
def many(tmp_path_factory):
    """Those thirty shards made in one go: their hashes, and the specification's file."""
    folder = tmp_path_factory.mktemp("many")
    path = folder / "many.toml"
    path.write_text(toml_of(MANY), encoding="utf-8")
    generate(path, folder / "out", workers=1)
    return hashes(folder / "out"), path


@pytest.mark.slow
def test_neither_workers_nor_order_change_a_byte(tmp_path):
    for workers in (1, 2):
        assert generate(RICH, tmp_path / str(workers), workers=workers) == tmp_path / str(workers) / "manifest.json"
    one = hashes(tmp_path / "1")
    assert set(one) == {"README.md", "manifest.json", *(f"shard-00000{shard}.nc" for shard in range(3))}
    assert one == hashes(tmp_path / "2")


def test_manifest_states_everything(tmp_path):
    spec = changed(PLAIN, contours=[{"family": "circle", "r": 0.5, "q": {"uniform": [0.5, 1.2]}}])
    path = generate(spec, tmp_path, workers=1)
    stated = json.loads(path.read_text())
    assert stated["complete"] is True
    assert (stated["records"], stated["seed"], stated["name"]) == (24, 7, "parabolas")
    assert set(stated["versions"]) >= {"python", "tactile-bayes", "numpy", "scipy", "h5py"}
    assert stated["redrawn"]["out of reach"] > 0
    for shard in stated["shards"]:
        content = (tmp_path / shard["file"]).read_bytes()
        assert (hashlib.sha256(content).hexdigest(), len(content)) == (shard["sha256"], shard["bytes"])
    in_shards = [shard["redrawn"].get("out of reach", 0) for shard in stated["shards"]]
    assert sum(in_shards) == stated["redrawn"]["out of reach"]
    card = (tmp_path / "README.md").read_text()
    assert f"{sum(stated['redrawn'].values())} contours were drawn again (" in card
    assert "| circle: q | uniform from 0.5 to 1.2 |" in card
    verify(tmp_path)


def test_progress_is_told(tmp_path):
    told = []
    generate(PLAIN, tmp_path, workers=Workers(1, progress=told.append))
    assert [(p.done, p.wanted, p.made) for p in told] == [(8, 24, 8), (16, 24, 16), (24, 24, 24)]
    (tmp_path / "shard-000001.nc").unlink()
    generate(PLAIN, tmp_path, workers=Workers(1, progress=told.append))
    assert told[-1][:3] == (24, 24, 8)
    generate(PLAIN, tmp_path, workers=Workers(1, progress=told.append))
    assert len(told) == 4


@pytest.mark.slow
@on_linux
def test_killed_at_random_moments_it_goes_on(many, tmp_path):
    """From when the folder is there: what the manifest states is whole, and nobody works on."""
    expected, spec = many
    moments, out, kills = random.Random(2), tmp_path / "out", 8
    for _ in range(kills):
        command = [sys.executable, "-c", GENERATE, str(spec), str(out), "2"]
        run = subprocess.Popen(command, cwd=TESTS, stderr=subprocess.PIPE, text=True, start_new_session=True)
        wait_until(lambda run=run: run.poll() is not None or (out / "manifest.json").exists())
        goal = len(list(out.glob("shard-*.nc"))) + moments.randrange(1, 24 // kills + 2)
        wait_until(lambda run=run, goal=goal: run.poll() is not None or len(list(out.glob("shard-*.nc"))) >= goal)
        time.sleep(moments.uniform(0.0, 0.02))
        children = Path(f"/proc/{run.pid}/task/{run.pid}/children")
        team = [int(child) for child in children.read_text().split()] if run.poll() is None else []
        run.kill()
        _, words = run.communicate()
        assert run.returncode in (0, -signal.SIGKILL), words
        wait_until(lambda team=team: not any(map(alive, team)))
        for shard in read_manifest(out).shards:
            assert hashlib.sha256((out / shard.file).read_bytes()).hexdigest() == shard.sha256, shard.file
    generate(spec, out, workers=1)
    assert hashes(out) == expected
    verify(out)


@pytest.mark.slow
@on_linux
def test_a_cluster_makes_the_same_though_a_worker_is_killed(many, tmp_path):
    """A scheduler and two workers, each a process of its own, on loopback."""
    pytest.importorskip("distributed")
    expected, spec = many
    address = tmp_path / "scheduler.json"
    with ExitStack() as ends:

        def launch(kind, *options):
            command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", "--no-dashboard", *map(str, options)]
            silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
            process = ends.enter_context(subprocess.Popen(command, cwd=tmp_path, **silent))
            ends.callback(process.kill)
            return process

        launch("scheduler", "--host", "127.0.0.1", "--port", 0, "--scheduler-file", address)
        wait_until(lambda: address.exists() and address.read_text().rstrip().endswith("}"))
        where = json.loads(address.read_text())["address"]
        options = where, "--no-nanny", "--nthreads", 1, "--local-directory", tmp_path
        first, second = (launch("worker", *options) for _ in range(2))

        def kill_one(state):
            if state.made >= 12 and first.poll() is None:
                first.kill()

        generate(spec, tmp_path / "out", workers=Workers(where, progress=kill_one))
        assert first.wait(10) == -signal.SIGKILL
        assert second.poll() is None
        assert hashes(tmp_path / "out") == expected


@pytest.mark.parametrize("name", ["", "shard-000000.nc", "README.md"])
def test_files_of_unknown_origin_are_left_alone(tmp_path, name):
    """Also one in place of the folder."""
    out = tmp_path / "out"
    if name:
        out.mkdir()
    (out / name).write_text("mine")
    with refused(SpecificationError, name or out):
        generate(PLAIN, out)
    assert (out / name).read_text() == "mine"


def test_another_data_set_is_left_alone(folder):
    before = hashes(folder)
    (contour,), pivots = PLAIN["contours"], [[0.1, 0.2]] * 9
    circle = {"family": "circle", "r": 1.0, "q": {"each": [0.3, 0.5]}}
    rod = {"length": 0.2, "flexural_rigidity": 2.4e-3}
    for change, named in (
        ({"seed": 8}, ["'parabolas'", "seed is 7 there and is 8 here"]),
        (
            {"contours": [{**contour, "q": {"normal": [0.5, 0.1]}}]},
            ["contours[0].q is {'uniform': [0.3, 0.7]} there and is {'normal': [0.5, 0.1]} here"],
        ),
        ({"contours": [contour, circle]}, ["contours[1].family", "left out there", "'circle' here"]),
        ({"contours": [circle | {"q": 0.5}]}, ["family", "'parabola'", "'circle'", "2 more"]),
        ({"rod": rod, "scan__bases": pivots}, ["scan.bases", "left out there", f"{str(pivots)[:59]}…", "rod.length"]),
        ({"unknown": {"friction": 0.1}}, ["unknown.friction", "left out there", "0.1 here"]),
        ({"name": "n", "seed": 8, "records": 48, "precision": "single"}, ["1 more"]),
        ({"records": 48}, ["records is 24 there and is 48 here", "grow"]),
    ):
        with refused(SpecificationError, "another specification", *named):
            generate(changed(PLAIN, **change), folder)
    assert hashes(folder) == before


@pytest.mark.slow
def test_a_run_that_made_nothing_stands_in_nobodys_way(tmp_path):
    """Nor do shards that its manifest did not come to state."""
    wrong = changed(PLAIN, contours=[{"family": "parabola", "a": 1.0, "q": -0.5}])
    with refused(SpecificationError, "1000 times"):
        generate(wrong, tmp_path, workers=1)
    (tmp_path / "shard-000007.nc").write_text("of a run that was killed")
    generate(PLAIN, tmp_path, workers=1)
    verify(tmp_path)


IN_STEP = {
    "scan": {"samples": 24, "bases": [[{"each": [0.0, 0.1]}, 0.0]]},
    "load_cell__force_noise": {"each": [0.01, 0.02], "axis": "noise"},
    "load_cell__moment_noise": {"each": [0.1, 0.2], "axis": "noise"},
}
CARDS = {
    "plain": ({}, "3 NetCDF files"),
    "one file": ({"shard_records": 24}, "in 1 NetCDF file, "),
    "thick": (
        {"rod": {"length": 1.0, "flexural_rigidity": 1.0, "diameter": 0.1}},
        "In 24 of 24 records the rod is strained beyond 0.1 (`truth_largest_strain`)",
    ),
    "fixed angles": (
        {"scan": {"samples": 24, "from_degrees": -20, "to_degrees": -10}},
        "driven far enough, reaches",
        "Of 48 sweeps, 48 have no",
    ),
    "tapered": ({"rod": {"taper": {"uniform": [0.2, 0.8]}}}, "| rod: taper | uniform from 0.2 to 0.8 |"),
    "drift": (
        {"load_cell__ornstein_uhlenbeck_force": 0.01},
        "| load cell: ornstein_uhlenbeck_time | 100 |",
        "drift and the unknown bias",
    ),
    "single": ({"precision": "single", "load_cell__force_range": 1.0}, "rounded to 32 bits"),
    "one list": (
        {"load_cell__force_noise": {"each": [0.01, 0.02, 0.03]}},
        "3 entries of load_cell.force_noise, 8 times.",
    ),
    "lists in step": (
        IN_STEP,
        "all 4 combinations of the lists, 6 times, ",
        ": scan.bases[0][0]; noise (load_cell.moment_noise and load_cell.force_noise in step).",
        "| load cell: force_noise | each of 0.01, 0.02, on the axis noise |",
    ),
}


@pytest.mark.parametrize("name", CARDS)
def test_the_card_says_what_else_there_is_to_know(name, tmp_path):
    change, *said = CARDS[name]
    generate(changed(PLAIN, **change), tmp_path, workers=1)
    card = (tmp_path / "README.md").read_text()
    assert [words for words in said if words not in card] == []
    if name == "plain":
        unsaid = ("Of 48", "_strain`", "drift", "entries of", "combinations", "32 bits")
        assert [words for words in unsaid if words in card] == []


@pytest.mark.parametrize("complete", [True, False])
def test_other_versions_do_not_go_on(folder, complete):
    """Neither with what was never complete, nor with what has lost a shard since."""
    manifest = read_manifest(folder)
    versions = {**manifest.versions, "numpy": "1.0"}
    shards = manifest.shards if complete else manifest.shards[:2]
    write_manifest(replace(manifest, versions=versions, shards=shards), folder)
    if complete:
        generate(PLAIN, folder, workers=1)
        verify(folder)
        assert read_manifest(folder).versions["numpy"] == "1.0"
        (folder / "shard-000001.nc").unlink()
    with refused(SpecificationError, "numpy 1.0"):
        generate(PLAIN, folder, workers=1)


def test_two_runs_at_once_in_one_folder_are_refused(tmp_path):
    pytest.importorskip("fcntl")
    with alone_in(tmp_path, SpecificationError), refused(SpecificationError, "another run"):
        generate(PLAIN, tmp_path)


MEMORY = """
import sys
from helpers.data_sets import PLAIN, changed
from helpers.memory import own_peak
from tactile_bayes.datasets import generate
spec = changed(PLAIN, records=int(sys.argv[2]), shard_records=50, scan__samples=180)
generate(spec, sys.argv[1], workers=1)
print(own_peak())
"""


@on_linux
@pytest.mark.slow
def test_memory_does_not_grow_with_the_number_of_records(tmp_path):
    """Ten times the records, at most a tenth more memory."""
    few, many = (
        int(subprocess.check_output([sys.executable, "-c", MEMORY, tmp_path / str(n), str(n)], cwd=TESTS))
        for n in (200, 2000)
    )
    assert many < 1.1 * few
