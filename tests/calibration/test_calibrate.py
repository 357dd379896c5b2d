"""Calibration from end to end: what it refuses, what it keeps, and that it finds what is wrong."""

import importlib
import inspect
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from helpers.refusals import refused
from helpers.tasks import StrangeError
from tactile_bayes import Family, LoadCell, Motion, Rig, Rod, Rotation, SamplerSettings, Translation, calibrate
from tactile_bayes.calibration.calibrate import calibration_replicate, experiment_of
from tactile_bayes.calibration.replicate import REPLICATES, Outcome
from tactile_bayes.calibration.simulated_experiment import Misspecification
from tactile_bayes.errors import CalibrationError, ParameterError
from tactile_bayes.inference.contour import sampled
from tactile_bayes.inference.ensembles import moves
from tactile_bayes.numerics.random_numbers import child
from tactile_bayes.rig import NOTHING
from tactile_bayes.tasks import Workers

module = importlib.import_module("tactile_bayes.calibration.calibrate")
making = importlib.import_module("tactile_bayes.calibration.replicate")

PRIORS = {"a": stats.lognorm(s=0.4, scale=0.6), "q": stats.uniform(0.3, 0.4), "x_c": stats.norm(0.0, 0.1)}
ANGLES = np.radians(np.arange(-30.0, 211.0, 4.0))
DRIVE = Rotation(drive_angles=ANGLES)

FAMILY = Family("parabola", **PRIORS)
AS_STATED = Rig(unknown="nothing")

FORTH, BACK = Translation((0.9, 0.0), np.pi, 1.0, 1.8), Translation((-0.9, 0.0), 0.0, np.pi - 1.0, 1.8)

# Enough for numbers that are the same again, not for right ones.
FEW_STEPS = SamplerSettings(ensembles=2, walkers=20, block_steps=10, max_steps=20)
BY_DEFAULT = SamplerSettings(ensembles=2, walkers=20, block_steps=25, max_r_hat=1.05, min_ess=200.0, max_steps=500)


def quickly(**options):
    asked = {"family": FAMILY, "rig": AS_STATED, "replicates": 2, "drive": DRIVE, "rng": 1, "workers": 1}
    return calibrate(**(asked | options))


def made_up(task):
    """In place of a replicate: numbers that follow from seed and number alone."""
    experiment, number = task
    rng = np.random.default_rng(child(experiment.seed, number))
    numbers = {"seconds": 0.0, "snap_off": 0.5 * int(rng.integers(3)), "width_in_gap": np.nan}
    return Outcome({"a": int(rng.integers(100)), "q": int(rng.integers(100))}, numbers, "converged")


@pytest.fixture
def noted(monkeypatch):
    """Numbers of the replicates that are made, which take no time."""
    numbers = []
    monkeypatch.setattr(module, "replicate", lambda task: numbers.append(task[1]) or made_up(task))
    return numbers


def rows_of(folder):
    return json.loads((folder / REPLICATES.file).read_text(encoding="utf-8"))["replicates"]


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Two replicates of few steps, in this process, and where they are kept."""
    folder = tmp_path_factory.mktemp("small") / "on the way"
    return quickly(settings=FEW_STEPS, out=folder), folder


def test_what_is_found(small):
    found, _ = small
    assert found.sizes == {"replicate": 2, "quantity": 7, "claim": 6}
    assert {*PRIORS, "noise_scale", "log_likelihood", "snap_off_forward"} < set(found.quantity.values)
    assert np.all((found["ranks"] >= 0) & (found["ranks"] <= 99))
    assert np.all((found.coverage >= 0.0) & (found.coverage <= 1.0))
    assert np.all(found.width_in_gap > 0.0)
    assert np.all(found.evaluations > 0)
    assert (found.attrs["conclusion"], found.attrs["replicates"]) == ("too few", 2)


@pytest.mark.slow
def test_workers_change_nothing_but_the_seconds(small):
    found, _ = small
    other = quickly(settings=FEW_STEPS, workers=2)
    assert other.drop_vars("seconds").identical(found.drop_vars("seconds"))


# Functions that fail in replicates 0, 1 and 2, and what their errors say.
STAGES = {"simulate": "of the simulation", "sampled": "of inference", "_snap_offs": "of what comes after"}


def failing(task):
    """A replicate, where the first three fail, each at another stage, with an error that nobody expects."""
    with pytest.MonkeyPatch.context() as patch:
        for stage, words in list(STAGES.items())[task[1] : task[1] + 1]:

            def fail(*arguments, words=words, **options):
                raise StrangeError("an error", words)

            patch.setattr(making, stage, fail)
        return making.replicate(task)


def test_a_failure_is_an_outcome_whatever_it_comes_from(tmp_path, monkeypatch):
    """Of three replicates that fail, each at another stage, and one that does not."""
    monkeypatch.setattr(module, "replicate", failing)
    found = quickly(replicates=4, settings=FEW_STEPS, out=tmp_path)
    assert (found.sizes["replicate"], found.attrs["lost"]) == (4, 3)
    np.testing.assert_array_equal((found["ranks"] >= 0).any("quantity"), [False, False, False, True])
    rows = rows_of(tmp_path)
    for number, ((stage, words), row) in enumerate(zip(STAGES.items(), rows, strict=False)):
        message = f"StrangeError: an error {words}"
        assert (row["number"], row["ranks"], row["message"]) == (number, {}, message)
        assert f"{stage}(" in row["traceback"]
        assert row["traceback"].endswith(f"{message}\n")
        assert (str(found.message[number].values), str(found.traceback[number].values)) == (message, row["traceback"])
    assert "traceback" not in rows[3]
    assert str(found.traceback[3].values) == ""
    for part in ("1 posteriors", "3 lost", ": 0, 1, 2 (StrangeError)", "--replicate 0 --debug"):
        assert part in found.attrs["verdict"]
    # A second call makes nothing, also of what is lost, and finds the same, to the last digit.
    monkeypatch.setattr(module, "replicate", pytest.fail)
    assert quickly(replicates=4, settings=FEW_STEPS, out=tmp_path).identical(found)
    assert [path.name for path in tmp_path.iterdir()] == [REPLICATES.file]


@pytest.mark.parametrize("stage", ["simulate", pytest.param("sampled", marks=pytest.mark.slow)])
def test_an_interrupt_is_no_failure_and_loses_the_replicate(tmp_path, monkeypatch, stage):
    """Nor half a replicate: a sampler that is interrupted gives what it has, which is no posterior to be judged."""

    def interrupt(*arguments):
        raise KeyboardInterrupt

    def interrupted(problem, **options):
        return sampled(problem, **options, progress=interrupt)

    monkeypatch.setattr(making, stage, interrupt if stage == "simulate" else interrupted)
    with pytest.raises(KeyboardInterrupt, match="replicate 0" if stage == "sampled" else None):
        quickly(settings=FEW_STEPS, out=tmp_path)
    assert rows_of(tmp_path) == []


def again(number, **options):
    asked = {"family": FAMILY, "rig": AS_STATED, "drive": DRIVE, "settings": FEW_STEPS, "rng": 1}
    return calibration_replicate(number, **(asked | options))


@pytest.mark.slow
def test_a_replicate_is_the_same_again(small):
    found, folder = small
    before, made = (folder / REPLICATES.file).read_bytes(), again(1, out=folder)
    ranks, numbers = made.outcome.ranks, made.outcome.numbers
    assert (made.number, made.outcome.message) == (1, str(found.message[1].values))
    assert ranks == {name: int(found["ranks"].sel(replicate=1, quantity=name)) for name in found.quantity.values}
    for name in set(numbers) - {"seconds"}:
        np.testing.assert_array_equal(numbers[name], found[name][1])
    assert list(made.truth) == [*PRIORS, "noise_scale"]
    assert made.measured.sizes["sample"] == 2 * ANGLES.size
    assert list(made.posterior["posterior"].data_vars) == list(made.truth)
    assert (folder / REPLICATES.file).read_bytes() == before


def test_the_error_is_raised_where_a_replicate_is_lost(monkeypatch):
    def fail(*arguments, **options):
        raise ZeroDivisionError("nothing left")

    monkeypatch.setattr(making, "sampled", fail)
    with pytest.raises(ZeroDivisionError, match="nothing left"):
        again(0)
    made = again(0, throw=False)
    assert (made.outcome.is_lost, made.outcome.message) == (True, "ZeroDivisionError: nothing left")
    assert list(made.truth) == [*PRIORS, "noise_scale"]
    assert made.measured.sizes["sample"] == 2 * ANGLES.size
    assert made.posterior is None
    monkeypatch.setattr(making, "simulate", fail)
    made = again(0, throw=False)
    assert (made.truth, made.measured, made.posterior) == ({}, None, None)


@pytest.mark.slow
def test_what_has_not_converged_is_run_again_with_more_walkers(monkeypatch):
    """By default alone: settings that are given are those of the only run."""
    runs = []

    def spied(problem, *, settings, **options):
        runs.append(settings)
        return sampled(problem, settings=FEW_STEPS, **options)

    monkeypatch.setattr(making, "sampled", spied)
    assert not again(0, settings=None).outcome.numbers["converged"]
    again(0)
    assert runs == [BY_DEFAULT, replace(BY_DEFAULT, walkers=None, max_steps=6000), FEW_STEPS]


def test_a_replicate_of_another_calibration_is_refused(small):
    with refused(CalibrationError, seed=1):
        again(0, out=small[1], rng=2)
    for number in (-1, True, "1"):
        with refused(ParameterError, repr(number)):
            again(number)


def test_defaults_of_one_replicate_are_those_of_all():
    own, every = (dict(inspect.signature(function).parameters) for function in (experiment_of, calibrate))
    assert {name: every.pop(name).default for name in own} == {name: option.default for name, option in own.items()}
    assert set(every) == {"replicates", "out", "workers"}


def test_more_replicates_begin_with_those_that_are_there(noted, tmp_path):
    told = []
    whole = quickly(replicates=5)
    assert not np.array_equal(whole["ranks"], quickly(replicates=5, rng=2)["ranks"])
    noted.clear()
    for count in (2, 5):
        found = quickly(replicates=count, out=tmp_path, workers=Workers(1, told.append))
    assert found.identical(whole)
    assert noted == [0, 1, 2, 3, 4]
    made = [(1, 2, 1), (2, 2, 2), (3, 5, 1), (4, 5, 2), (5, 5, 3)]
    assert [(state.done, state.wanted, state.made) for state in told] == made
    fewer = quickly(replicates=3, out=tmp_path)
    assert (fewer.sizes["replicate"], len(noted), len(rows_of(tmp_path))) == (3, 5, 5)  # none is lost
    table = json.loads((tmp_path / REPLICATES.file).read_text())
    del table["replicates"][1]
    (tmp_path / REPLICATES.file).write_text(json.dumps(table))
    assert quickly(replicates=5, out=tmp_path).identical(whole)
    assert noted[5:] == [1]  # a gap is filled


@pytest.mark.parametrize(
    ("other", "differs"),
    [
        ({"rng": 2}, ("seed", 1, 2)),
        ({"rig": AS_STATED.with_unknown(friction=0.1)}, ("unknown", 0.1)),
        ({"rig": AS_STATED.with_unknown(bias="default")}, ("unknown", "default")),
        ({"rig": replace(AS_STATED, load_cell=LoadCell(force_noise=0.1, moment_noise=0.02))}, ("load_cell", 0.05, 0.1)),
        ({"truth": AS_STATED.with_unknown(friction=0.1)}, ["truth_unknown"]),
        ({"truth": replace(AS_STATED, rod=Rod(taper=0.1))}, ["truth_rod"]),
        ({"truth": Misspecification(base_shift=(0.1, 0.0))}, ("misspecification", 0.1)),
        ({"truth": Misspecification(family=Family("parabola", a=stats.norm(1.0)))}, ["truth_contour"]),
        ({"settings": FEW_STEPS}, ["settings"]),
        ({"drive": Rotation(drive_angles=ANGLES[:-1])}, ["drives"]),
        ({"drive": Rotation(direction="forward", drive_angles=ANGLES)}, ["drives"]),
        ({"family": "parabola"}, ["contour"]),
        ({"drive": Rotation((0.1, 0.0), drive_angles=ANGLES)}, ["drives"]),
        ({"drive": [FORTH, BACK]}, ["drives"]),
        ({"settings": replace(BY_DEFAULT, events=False)}, ("settings", "events", "false", "true")),
    ],
)
def test_another_calibration_is_left_alone(noted, tmp_path, other, differs):
    quickly(out=tmp_path)
    before = (tmp_path / REPLICATES.file).read_bytes()
    with refused(CalibrationError, "another experiment", *differs):
        quickly(out=tmp_path, **other)
    assert (tmp_path / REPLICATES.file).read_bytes() == before
    assert noted == [0, 1]


@pytest.mark.parametrize(
    "same",
    [
        {"rng": np.int64(1)},
        {"drive": [Rotation(drive_angles=ANGLES[::-1])]},
        {"truth": Misspecification(base_shift=[0.0, 0.0])},
        {"truth": AS_STATED},
        {"rig": Rig(load_cell=LoadCell(force_noise=0.05, moment_noise=0.02), unknown=NOTHING)},
        {"settings": replace(BY_DEFAULT, ensembles=np.int64(2))},
    ],
    ids=lambda same: next(iter(same)),
)
def test_the_same_in_other_words_is_the_same(same):
    asked = {"family": FAMILY, "rig": AS_STATED, "drive": DRIVE, "rng": 1}
    words = experiment_of(**asked).identity
    assert experiment_of(**(asked | same)).identity == words
    assert all(isinstance(said, str) for said in words.values())
    written_out = {"drive": [Rotation((0, 0))], "settings": BY_DEFAULT, "truth": Misspecification()}
    defaults = experiment_of(rig=AS_STATED, rng=1).identity
    assert experiment_of("parabola", AS_STATED, rng=1, **written_out).identity == defaults


@pytest.mark.slow
def test_a_replicate_is_scored_by_the_travel_of_its_end():
    family = Family("circle", r=stats.uniform(0.25, 0.1), q=stats.uniform(0.75, 0.1), x_c=stats.norm(0.0, 0.02))
    drive = [Translation((0.8, 0.0), np.pi, 1.1, 1.6), Motion([-0.8, 0.8], 0.0, [2.2, 1.6])]
    replicate = calibration_replicate(0, family, AS_STATED, rng=1, drive=drive)
    assert replicate.outcome.message.startswith("converged")
    assert {"snap_off_forward", "snap_off_backward"} <= replicate.outcome.ranks.keys()
    measured = replicate.measured
    assert np.unique(measured.sweep.values).tolist() == [0, 1]
    assert measured.direction.values[[0, -1]].tolist() == ["forward", "backward"]
    np.testing.assert_allclose(measured.base_x.values[[0, 120, 121, 241]], [0.8, -0.8, -0.8, 0.8], atol=1e-12)


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"replicates": 0}, ["replicates", "0"]),
        ({"workers": 0}, ["workers", "0"]),
        ({"drive": []}, ["drive", "[]"]),
        ({"truth": "real"}, ["truth", "'real'"]),
        ({"family": "cube"}, ["'cube'", "parabola"]),
        ({"drive": Rotation(drive_angles=[0.0, 1.0])}, ["drive_angles", "3"]),
        ({"rig": Rig(load_cell=LoadCell())}, ["load cell", "noise"]),
        ({"truth": Rig(load_cell=LoadCell())}, ["load cell", "truth", "noise"]),
    ],
    ids=str,
)
def test_bad_arguments_are_refused_before_there_is_a_folder(noted, tmp_path, wrong, named):
    out = tmp_path / "out"
    with refused(ParameterError, *named):
        quickly(**({"out": None if "workers" in wrong else out} | wrong))
    assert not out.exists()
    assert noted == []


@pytest.mark.slow
def test_the_right_posterior_passes():
    """False alarm 1 %, but for numbers that are the same again."""
    found = quickly(replicates=60, workers=None)
    assert found.attrs["calibrated"] == 1, found.attrs["verdict"]


@pytest.mark.slow
@pytest.mark.parametrize("family", ["parabola", "circle"])
def test_the_right_posterior_of_a_carried_rod_passes(family):
    found = calibrate(family, rng=3, replicates=60, drive=[FORTH, BACK], workers=2)
    assert found.attrs["conclusion"] == "calibrated", found.attrs["verdict"]


@pytest.mark.slow
def test_what_is_at_an_end_of_its_prior_has_no_rank():
    found = quickly(replicates=2, rig=AS_STATED.with_unknown(friction="default"), truth=AS_STATED)
    assert "friction" not in found["quantity"].values
    assert "log_likelihood" in found["quantity"].values


def finds(found, quantity, way):
    assert found.attrs["calibrated"] == 0
    assert re.search(rf"{quantity}: [\w ]* {way}\b", found.attrs["verdict"])


@pytest.mark.slow
def test_noise_larger_than_told_is_found():
    """Of 10 %, where it is sure to 1 %: posteriors lie some nine times that too low; power is above 99.9 %."""
    rig = AS_STATED.with_unknown(noise_scale=stats.lognorm(s=0.01))
    truth = replace(rig, load_cell=LoadCell(force_noise=0.055, moment_noise=0.022))
    finds(quickly(replicates=25, rig=rig, truth=truth, workers=None), "noise_scale", "low")


@pytest.mark.slow
def test_a_shifted_prior_is_found():
    """Rods are stiffer by 2 % than the prior says, which is sure to 1 %, where noise leaves much to the prior.

    Posteriors lie 1.7 of their standard deviations too low; power is above 99.9 %.
    """
    rig = Rig(load_cell=LoadCell(force_noise=0.5, moment_noise=0.2), unknown="nothing")
    stiff, stiffer = (rig.with_unknown(rigidity_scale=stats.lognorm(s=0.01, scale=scale)) for scale in (1.0, 1.02))
    finds(quickly(replicates=40, rig=stiff, truth=stiffer, workers=None), "rigidity_scale", "low")


@pytest.mark.slow
def test_a_wrong_sampler_is_found(monkeypatch):
    """Its moves divide by what they should multiply with: the ratio of the proposal's densities has the wrong sign.

    Posteriors are some 0.6 times as wide as they should be, and their draws too likely. Power is above 99 %,
    of 200 times 40 replicates that are drawn from 60.
    """
    right = moves.FittedMove.get_proposal

    def turned(self, *arguments):
        there, ratio = right(self, *arguments)
        return there, np.where(np.isfinite(ratio), -ratio, ratio)

    monkeypatch.setattr(moves.FittedMove, "get_proposal", turned)
    finds(quickly(replicates=40), "log_likelihood", "worse")
