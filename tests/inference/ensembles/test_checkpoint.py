"""Runs that are killed, stopped or ended, and go on from what is on disk."""

import json
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from helpers.refusals import refused
from tactile_bayes import SamplerSettings
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.coordinates import Coordinates
from tactile_bayes.inference.ensembles import Draws, checkpoint, sample

SMALL = SamplerSettings(ensembles=2, walkers=8, block_steps=10, max_steps=60, min_ess=1e9)
STEADY = SamplerSettings(ensembles=2, walkers=8, block_steps=20, max_steps=4000, min_ess=200, max_r_hat=1.05)


@pytest.fixture(autouse=True)
def _every_block_is_stored(monkeypatch):
    """However soon after the one before."""
    monkeypatch.setattr(checkpoint, "_SECONDS", 0.0)


def stated(folder, **changed):
    """What the checkpoint in a folder states of its run, after changes to it, or to all of it as a text."""
    path = folder / "checkpoint.npz"
    with np.load(path, allow_pickle=False) as arrays:
        content = dict(arrays)
    table = json.loads(str(content["description"]))
    if changed:
        content["description"] = np.array(changed.get("text") or json.dumps(table | changed))
        np.savez(path, **content)
    return table


def steps_in(folder):
    """Number of steps in a checkpoint, of each ensemble."""
    return stated(folder)["steps"] if (folder / "checkpoint.npz").exists() else 0


class Killed(BaseException):
    """Stands for the end of a process: nothing after it runs."""


class Counted:
    """A bent target, whose evaluations are counted, and which can end the process at one of them."""

    def __init__(self, killed_at: int | None = None, error: type[BaseException] = Killed) -> None:
        self.calls, self._killed_at, self._error = 0, killed_at, error

    def __call__(self, x):
        self.calls += 1
        if self.calls == self._killed_at:
            raise self._error
        return -0.5 * (x[:, 0] ** 2 + (x[:, 1] - np.abs(x[:, 0])) ** 2)


def draw(folder=None, *, target=None, settings=SMALL, seed=3, names=("a", "b"), scale=2.0, **options) -> Draws:
    start = scale * np.random.default_rng(0).normal(size=(settings.ensembles, settings.walkers, len(names)))
    return sample(
        Counted() if target is None else target,
        start,
        names=names,
        seed=seed,
        settings=settings,
        checkpoint=folder,
        **options,
    )


@cache
def whole() -> Draws:
    """Of a run that nothing stops; not to be changed."""
    return draw()


def assert_same(one: Draws, other: Draws) -> None:
    for name in ("samples", "log_probability", "r_hat", "ess_bulk", "ess_tail", "acceptance", "autocorrelation_time"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    for name in ("names", "walkers", "steps_kept", "steps_run", "evaluations", "converged", "message", "stuck"):
        assert getattr(one, name) == getattr(other, name), name


def content(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@dataclass(frozen=True, eq=False)
class Scaled(Coordinates):
    """Parameters over their standard deviations, as the first steps show them."""

    scale: np.ndarray

    @property
    def fitted(self):
        return {"scale": self.scale}

    def parameters(self, coordinates):
        return self.scale * coordinates, np.full(len(coordinates), np.log(self.scale).sum())

    def of(self, points):
        return points / self.scale

    def adapted(self, draws):
        return Scaled(self.scale * draws.std(axis=(0, 1)))


@pytest.mark.parametrize("calls", [43, 77])
def test_coordinates_that_a_run_has_fitted_are_those_with_which_it_goes_on(tmp_path, calls):
    """Killed before the third and the fourth time that they are."""
    begun = Scaled(np.array([0.1, 3.0]))
    with pytest.raises(Killed):
        draw(tmp_path, target=Counted(killed_at=calls), coordinates=begun)
    with np.load(tmp_path / "checkpoint.npz") as arrays:
        assert np.all(np.abs(np.log(arrays["fitted_scale"] / begun.scale)) > 0.5)
    assert_same(draw(tmp_path, coordinates=begun), draw(coordinates=begun))


@pytest.mark.parametrize(("calls", "made"), [(1, 0), (25, 10), pytest.param(97, 44, marks=pytest.mark.slow)])
def test_a_run_goes_on_bit_by_bit_wherever_it_was_killed(tmp_path, calls, made):
    """Killed in steps 0, 12 and 48: what is kept are those at the diagnosis before, after 10, 13 … 35, 44, 55."""
    with pytest.raises(Killed):
        draw(tmp_path, target=Counted(killed_at=calls))
    assert steps_in(tmp_path) == made
    target = Counted()
    assert_same(draw(tmp_path, target=target), whole())
    assert target.calls == 2 * (SMALL.max_steps - made) + (0 if made else 2)


@pytest.mark.slow
def test_a_run_that_has_ended_is_made_longer_only_by_stricter_settings(tmp_path):
    first, before = draw(tmp_path, settings=STEADY), content(tmp_path)
    assert first.converged
    target, seen = Counted(), []
    assert_same(draw(tmp_path, settings=STEADY, target=target, progress=seen.append), first)
    assert target.calls == 0
    assert [state.steps for state in seen] == [first.steps_run]
    assert content(tmp_path) == before
    assert_same(draw(tmp_path, settings=replace(STEADY, min_ess=100)), first)
    strict = replace(STEADY, min_ess=1.5 * float(first.ess_tail.min()))
    longer = draw(tmp_path, settings=strict)
    assert longer.steps_run > first.steps_run
    assert_same(longer, draw(settings=strict))


@pytest.mark.parametrize("steps", [30, pytest.param(35, marks=pytest.mark.slow)])
def test_a_run_out_of_steps_goes_on_with_more_of_them(tmp_path, steps):
    few, target = replace(SMALL, max_steps=steps), Counted()
    draw(tmp_path, settings=few)
    assert_same(draw(tmp_path, settings=few, target=target), draw(settings=few))
    assert target.calls == 0
    assert_same(draw(tmp_path), whole())
    assert draw(tmp_path, settings=few).steps_run == SMALL.max_steps  # what is there is never dropped


def test_a_run_out_of_time_goes_on_with_the_same_time_again(tmp_path):
    few = replace(SMALL, max_steps=4)
    hasty = replace(few, max_seconds=1e-9)
    steps, kept = [], [0.0]
    for _ in range(4):
        part = draw(tmp_path, settings=hasty)
        steps.append(part.steps_run)
        kept.append(stated(tmp_path)["seconds"])
        assert part.seconds >= kept[-1]  # what comes after the state is on disk is not kept
    assert steps == [1, 2, 3, 4]
    assert all(later > earlier for earlier, later in pairwise(kept))
    np.testing.assert_array_equal(part.samples, draw(settings=few).samples)


def test_a_run_that_ended_between_two_looks_is_judged_there_again(tmp_path):
    """Of the plan 79, 99, 124 no look is at 100, and a run that was killed there goes on to the next."""
    strict, loose = replace(STEADY, min_ess=1e9), replace(STEADY, min_ess=1.0, max_r_hat=10.0)
    draw(tmp_path, settings=replace(strict, max_steps=99))
    assert draw(tmp_path, settings=replace(strict, max_seconds=1e-9)).steps_run == 100
    target = Counted()
    first = draw(tmp_path, settings=loose, target=target)
    assert (first.converged, first.steps_run, target.calls) == (True, 100, 0)
    stated(tmp_path, is_end=False)
    assert draw(tmp_path, settings=loose).steps_run == 124


def test_an_interrupt_keeps_the_whole_blocks_and_gives_what_is_there(tmp_path):
    draws = draw(tmp_path, target=Counted(killed_at=2 + 2 * 24, error=KeyboardInterrupt))
    assert "interrupted" in draws.message
    assert 22 < draws.steps_run < 28
    assert steps_in(tmp_path) == 22
    draws = draw(tmp_path, target=Counted(killed_at=1, error=KeyboardInterrupt))
    assert "interrupted" in draws.message
    np.testing.assert_array_equal(draws.samples, draw(settings=replace(SMALL, max_steps=22)).samples)
    assert_same(draw(tmp_path), whole())


def test_a_checkpoint_is_written_at_the_end_and_every_few_seconds(tmp_path, monkeypatch):
    monkeypatch.setattr(checkpoint, "_SECONDS", 600.0)
    with pytest.raises(Killed):
        draw(tmp_path, target=Counted(killed_at=60))
    assert steps_in(tmp_path) == 0
    draw(tmp_path)
    assert steps_in(tmp_path) == 60


def refuse(folder, *named, **options):
    before = content(folder)
    target = Counted()
    with refused(InferenceError, *named):
        draw(folder, target=target, **options)
    assert target.calls == 0
    assert content(folder) == before


SAME = {"data": "a" * 64, "model": "parabola"}
OTHER_SEED = np.random.SeedSequence(3, spawn_key=(1,))


@pytest.fixture
def begun(tmp_path):
    draw(tmp_path, settings=replace(SMALL, max_steps=30), identity=SAME)
    return tmp_path


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"identity": {**SAME, "model": "circle"}}, ["model is parabola there and circle here"]),
        ({"identity": {"model": "parabola"}}, ["data", "left out here"]),
        ({"identity": {**SAME, "rod": "1"}}, ["rod is left out there and 1 here"]),
        ({"seed": 4}, ["seed of the ensembles is 3, pool of 4 there and 4, pool of 4 here"]),
        ({"seed": OTHER_SEED}, ["3, spawn key (1,), pool of 4 here"]),
        ({"names": ("a", "c")}, ["names of parameters is a, b there and a, c here"]),
        ({"scale": 3.0}, ["starting points"]),
        ({"settings": replace(SMALL, block_steps=20)}, ["block_steps"]),
        ({"settings": replace(SMALL, walkers=10)}, ["walkers of an ensemble is 8 there and 10 here"]),
        ({"settings": replace(SMALL, ensembles=3)}, ["number of ensembles is 2 there and 3 here"]),
    ],
)
def test_another_run_is_refused_with_what_differs(begun, change, named):
    refuse(begun, *named, **{"identity": SAME} | change)


def test_an_integer_and_its_sequence_are_one_seed(begun):
    assert draw(begun, identity=SAME, seed=np.random.SeedSequence(3)).steps_run == 60


ENSEMBLES = {"kind": "ensembles of tactile-bayes", "format": 4, "steps": 0}


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"text": " "}, "damaged"),
        ({"text": "[]"}, "damaged"),
        ({"text": '{"step": 3}'}, "damaged"),
        ({"text": '{"kind": "weights", "format": 1}'}, "'weights'"),
        ({"text": json.dumps(ENSEMBLES | {"format": 5})}, "format 5"),
        ({"text": json.dumps(ENSEMBLES | {"identity": []})}, "damaged"),
        ({"text": json.dumps(ENSEMBLES | {"identity": {}})}, "left out there"),
        ({"identity": SAME | {"version of emcee": "3.1.5"}}, "version of emcee is 3.1.5 there"),
        ({"steps": 33}, "after 15 steps"),
    ],
)
def test_a_description_that_is_none_or_of_another_state_is_refused(begun, changed, named):
    stated(begun, **changed)
    refuse(begun, named, identity=SAME)


def test_a_file_and_a_folder_of_other_things_are_refused(tmp_path):
    (tmp_path / "results.nc").write_bytes(b"years of work")
    refuse(tmp_path, "'results.nc'", "checkpoint.npz")
    with refused(InferenceError, tmp_path / "results.nc"):
        draw(tmp_path / "results.nc")


def test_a_damaged_file_is_refused_or_as_it_was(tmp_path):
    """A byte flipped anywhere, or the file cut off anywhere: never other draws."""
    reference = draw(tmp_path, settings=replace(SMALL, max_steps=10))
    path = tmp_path / "checkpoint.npz"
    content = path.read_bytes()
    rng = np.random.default_rng(1)
    refused = 0
    size = len(content)
    for at in sorted({*range(0, 40, 2), *range(size - 60, size, 3), *rng.integers(0, size, 30).tolist()}):
        for damaged in (content[:at] + bytes([content[at] ^ 0x55]) + content[at + 1 :], content[:at]):
            path.write_bytes(damaged)
            try:
                again = draw(tmp_path, settings=replace(SMALL, max_steps=10))
            except InferenceError as error:
                refused += 1
                assert "is damaged" in str(error)  # noqa: PT017
            else:
                assert_same(again, reference)
            assert path.read_bytes() == damaged
    assert refused > 65


def test_one_folder_is_for_one_run_at_a_time(tmp_path):
    def other(_):
        with refused(InferenceError, "another run"):
            draw(tmp_path)
        raise KeyboardInterrupt

    assert draw(tmp_path, progress=other).steps_run == 10
    assert draw(tmp_path).steps_run == 60
