"""Paths as well as noise asks against exact ones, and contours by tables against contours by formulas."""

import gc
import os
import subprocess
import sys
from types import SimpleNamespace

import numba
import numpy as np
import pytest
from numba.core.errors import TypingError

from helpers.load_cells import CELL
from tactile_bayes.contours import Circle, Ellipse, Joined, Parabola, PowerLaw, ShapeFree, Smooth
from tactile_bayes.contours.families import family_named
from tactile_bayes.contours.sweep_frame import SweepFrame
from tactile_bayes.inference.parameters.priors import default_priors
from tactile_bayes.inference.parameters.unknowns import RigValues
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics import compiler
from tactile_bayes.mechanics.branches import sweeps
from tactile_bayes.mechanics.elastica import wrench_from_contact
from tactile_bayes.mechanics.paths import trace
from tactile_bayes.mechanics.reachability import Reachability
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.rig import Rig
from tactile_bayes.sweep import scan
from tactile_bayes.sweep.drive import Translation

SWEEPS = "tactile_bayes.mechanics.branches.sweeps"
THIN = Rod()
THICK = Rod(length=0.1, flexural_rigidity=1e-4, diameter=0.002)
NAMES = ["parabola", "circle", "ellipse", "power-law", "parabola/power-law", "circle/ellipse"]


def likelihood_of(rod, **options):
    """A record in both directions from two pivots, one of them to the side."""
    length = rod.length
    bases = [(0.0, 0.0), (0.15 * length, -0.1 * length)]
    record = scan(Parabola(0.5 / length, 0.5 * length), rig=Rig(rod=rod), base=bases).record
    unit = LoadCell(force_noise=0.05 * rod.force_unit, moment_noise=0.02 * rod.moment_unit)
    return RecordLikelihood(record, unit, **options)


def drawn(name, rod, count, seed=1):
    family = family_named(name)
    rng = np.random.default_rng(seed)
    priors = default_priors(family, (0.0, 0.0), rod.length)
    points = np.stack([priors[one].rvs(count, random_state=rng) for one in family.parameters])
    low, high = np.array([family.bounds[one] for one in family.parameters]).T
    inside = ((points > low[:, None]) & (points < high[:, None])).all(axis=0)
    return family.build(*points[:, inside])


# Each family, each rod with halves of two kinds, with and without friction.
ALWAYS = (
    ("parabola", "thin", 0.0),
    ("circle", "thick", 0.2),
    ("ellipse", "thin", 0.1),
    ("power-law", "thick", 0.0),
    ("parabola/power-law", "thick", 0.3),
    ("circle/ellipse", "thin", 0.0),
    ("circle", "thin", 0.6),
)


@pytest.mark.parametrize(
    ("name", "rod", "friction"),
    [
        pytest.param(
            name, rod, mu, id=f"{name}-{kind}-{mu}", marks=[] if (name, kind, mu) in ALWAYS else pytest.mark.slow
        )
        for name in NAMES
        for kind, rod in (("thin", THIN), ("thick", THICK))
        for mu in (0.0, 0.1, 0.2, 0.3, 0.6, 0.7)
    ],
)
def test_loads_and_usable_contours_are_the_exact_ones(name, rod, friction):
    contours = drawn(name, rod, 400)
    likelihood = likelihood_of(rod, is_always_clear=False, friction=friction)
    loads, usable = likelihood.predict(contours)
    exact, usable_exactly = likelihood_of(rod, is_always_clear=False, friction=friction, exact=True).predict(contours)
    # Snap-off is as good as the interpolation: a contour may be clear by less than that.
    assert np.count_nonzero(usable != usable_exactly) <= 2
    both = usable & usable_exactly
    assert np.count_nonzero(both) > 30
    assert np.count_nonzero(~usable) > 30
    off = np.abs(loads[both] - exact[both]) / likelihood.noise
    # Except for a sample at an event that falls on its other side.
    assert np.quantile(np.sqrt(np.square(off).sum(axis=(1, 2))), 0.95) < 0.015
    assert np.mean(off > 0.01) < 2e-3


@pytest.mark.parametrize(
    "friction", [0.3, *(pytest.param(mu, marks=pytest.mark.slow) for mu in (0.0, 1e-7, 1e-3, 0.05, 0.6))]
)
def test_neighbours_of_an_upright_rod_on_a_stage_are_all_reached(friction):
    """Its tip slides outward at first, and sticks at forces so small that the rod hardly yields along itself."""
    rng, count = np.random.default_rng(1), 300
    middle, spread = np.array([3.3, 0.41, 0.18]), np.array([0.05, 3e-3, 5e-3])
    contours = Parabola(*(middle + spread * rng.normal(size=(count, 3))).T)
    rig = RigValues(drive_angle_offset=0.01 * rng.normal(size=count), friction=friction)
    drive = [Translation((x, 0.0), heading, 0.5 * np.pi, 1.5) for x, heading in ((0.75, np.pi), (-0.75, 0.0))]
    record = scan(Parabola(3.3, 0.41, 0.18), rig=Rig(unknown={"friction": friction}), drive=drive).record
    likelihood, exactly = RecordLikelihood(record, CELL), RecordLikelihood(record, CELL, exact=True)
    loads, usable, events = likelihood.predict_with_events(contours, rig)
    exact, reached, expected = exactly.predict_with_events(contours, rig)
    assert usable.all()
    assert reached.all()
    assert np.quantile(np.abs(events - expected), 0.99) < 1e-5
    off = np.sqrt(np.square((loads - exact) / likelihood.noise).sum(axis=(1, 2)))
    assert np.quantile(off, 0.95) < 0.015


@pytest.mark.parametrize("friction", [0.0, 0.15])
def test_events_are_the_exact_ones(friction):
    """To the tolerance of a snap-off, as read: with an offset, and with the backlash of each direction."""
    contours = drawn("ellipse", THIN, 200)
    rig = RigValues(drive_angle_offset=0.02, drive_angle_backlash=0.01, friction=friction)
    likelihood = likelihood_of(THIN, is_always_clear=False)
    *_, usable, events = likelihood.predict_with_events(contours, rig)
    *_, expected = likelihood_of(THIN, is_always_clear=False, exact=True).predict_with_events(contours, rig)
    assert events.shape == (contours.shape[0], len(likelihood.segments), 2)
    assert np.count_nonzero(usable) > 30
    off = np.abs(events - expected)[usable]
    assert np.quantile(off, 0.99) < 1e-6
    assert off[..., 0].max() < 1e-9


def without_a_formula(contour):
    """The same, of which compiled code does not know a formula."""
    family = type(contour)
    other = type(family.__name__, (family,), {"halves": None})
    twin = object.__new__(other)
    twin.__dict__.update(vars(contour))
    return twin


COUNT = 60
RNG = np.random.default_rng(5)
Q, X_C = RNG.uniform(0.25, 0.8, COUNT), RNG.uniform(-0.3, 0.3, COUNT)
SIZES = np.exp(RNG.uniform(np.log(0.2), np.log(3.0), COUNT))
FORMULAS = {
    "parabola": Parabola(SIZES, Q, X_C),
    "circle": Circle(SIZES, Q, X_C),
    "ellipse": Ellipse(SIZES, SIZES[::-1], Q, X_C),
    "flat power": PowerLaw(SIZES, RNG.uniform(2.5, 6.0, COUNT), Q, X_C),
    "sharp power": PowerLaw(SIZES, RNG.uniform(1.2, 1.9, COUNT), Q, X_C),
    "joined": Joined(Parabola(SIZES, Q, X_C), Circle(SIZES[::-1], Q, X_C)),
    "smooth": Smooth(0.3 * RNG.normal(size=(COUNT, 4)) @ np.cos(np.outer(np.arange(4), Smooth.nodes(40))), Q, X_C),
}


@pytest.mark.parametrize("name", FORMULAS)
@pytest.mark.parametrize(
    ("backward", "friction", "length", "standoff"), [(False, 0.0, 1.0, 0.0), (True, 0.3, 1.1, 0.02)]
)
def test_a_contour_by_its_table_is_the_contour_by_its_formula(name, backward, friction, length, standoff):
    """States of sweeps, and all their events: 1e-9 of the largest load."""
    contours = FORMULAS[name]
    contours = contours.broadcast_to((COUNT,))
    angles = np.linspace(-0.5, 4.0, 91)
    found = []
    for one in (contours, without_a_formula(contours)):
        zero, side = np.zeros(COUNT), np.full(COUNT, backward)
        sweep_frame = SweepFrame(one, zero, zero, length, standoff, side)
        found.append(trace(sweep_frame, friction_angle=np.arctan(friction), drive_angles=angles))
    known, tabled = found
    np.testing.assert_array_equal(tabled.reach, known.reach)
    there = known.reach == Reachability.TOUCHES
    assert np.count_nonzero(there) > 20
    np.testing.assert_array_equal(tabled.snap_off, known.snap_off)
    for event in ("first_angle", "snap_angle", "first_parameter", "snap_parameter"):
        np.testing.assert_allclose(
            getattr(tabled, event)[there], getattr(known, event)[there], rtol=0.0, atol=1e-9, err_msg=event
        )
    np.testing.assert_array_equal(tabled.sampled[..., 0], known.sampled[..., 0])
    loads, expected = (paths.sampled[there][..., 6:9] for paths in (tabled, known))
    largest = np.abs(expected).max(axis=(1, 2), keepdims=True)
    assert np.all(np.abs(loads - expected) <= 1e-9 * largest)


def test_what_has_a_formula_and_what_has_a_table():
    edge = Joined(Parabola(0.5, 0.5, 0.1), Parabola(0.5, 0.5, -0.1), x=0.0)
    assert edge.halves is None
    assert ShapeFree(np.linspace(-1.5, 1.5, 7), np.zeros(7), x=0.0, y=0.3).halves is None
    assert Joined(Parabola(0.5, 0.5), Parabola(1.0, 0.5)).halves is not None


@pytest.mark.parametrize("options", [{}, {"friction": 0.2}, {"exact": True}], ids=["plain", "friction", "exact"])
@pytest.mark.parametrize("name", ["power-law", "table"])
def test_what_is_known_of_a_contour_does_not_depend_on_others_beside_it(name, options):
    likelihood = likelihood_of(THIN, **options)
    contours = without_a_formula(drawn("ellipse", THIN, 40)) if name == "table" else drawn(name, THIN, 40)
    contours = contours.broadcast_to(contours.shape)
    together = likelihood.log_likelihood(contours)
    apart = [likelihood.log_likelihood(contours.take(np.array([i])))[0] for i in range(contours.shape[0])]
    np.testing.assert_array_equal(together, apart)


def test_samples_may_come_in_any_order():
    """Also twice, and with angles that are no numbers, which are never loaded."""
    sweep_frame = SweepFrame(FORMULAS["parabola"].broadcast_to((COUNT,)), Q * 0.0, Q * 0.0, 1.0, 0.0, Q > 0.5)
    angles = np.linspace(0.3, 3.6, 40)
    order = np.random.default_rng(2).permutation(np.r_[np.arange(40), 7, 7])
    mixed = np.append(angles[order], np.nan)
    one, other = (trace(sweep_frame, drive_angles=each).sampled for each in (angles, mixed))
    np.testing.assert_array_equal(other[:, :-1], one[:, order])
    assert not np.any(other[:, -1])


# --- Compiling --------------------------------------------------------------------------------------------------------


def test_where_nothing_can_be_cached_it_is_compiled_each_time(monkeypatch):
    njit = compiler.numba.njit

    def without_a_place(function, *, cache=False, **options):
        if cache:
            raise RuntimeError("cannot cache function: no locator available")
        return njit(function, **options)

    monkeypatch.setattr(compiler.numba, "njit", without_a_place)

    def twice(x):
        return 2.0 * x

    assert compiler.cached(twice)(2.0) == 4.0


def test_states_of_scans_and_loads_of_likelihoods_are_compiled_once():
    """Other types than the first ones would take as long again, for instance arrays that are read-only."""
    sweep_frame = SweepFrame(FORMULAS["parabola"].broadcast_to((COUNT,)), Q * 0.0, Q * 0.0, 1.0, 0.0, Q > 0.5)
    trace(sweep_frame, drive_angles=np.linspace(0.3, 3.6, 40), relative=True, polished=False)
    for contours in (drawn("circle", THIN, 10), without_a_formula(drawn("circle", THIN, 10))):
        likelihood_of(THIN, is_always_clear=False).log_likelihood(contours.broadcast_to(contours.shape))
    uniform = [kinds for kinds in sweeps._solve.signatures if kinds[1] is numba.none]
    assert len(uniform) == 1


@pytest.mark.parametrize("awake", [True, False])
def test_the_garbage_collector_is_as_it_was_after_compiling_fails(awake):
    def ill_typed(x):
        return x + "one"

    ill_typed.__module__ = SWEEPS  # while a part of the forward model is compiled it rests
    try:
        if not awake:
            gc.disable()
        with pytest.raises(TypingError):
            compiler.cached(ill_typed)(1.0)
        assert gc.isenabled() == awake
    finally:
        gc.enable()


@pytest.mark.parametrize(("module", "terminal", "told"), [(SWEEPS, True, 1), (SWEEPS, False, 0), ("other", True, 0)])
def test_who_waits_at_a_terminal_is_told_once(module, terminal, told, capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    notice = compiler._Notice()
    function = SimpleNamespace(py_func=SimpleNamespace(__module__=module))
    for _ in range(2):
        notice.on_start(SimpleNamespace(data={"dispatcher": function}))
    assert capsys.readouterr().err.count("compiling the forward model") == told


SCANNED = """
import sys
import tactile_bayes as tb
sys.stderr.isatty = lambda: True
for _ in range(2):
    tb.mechanics.elastica.wrench_from_contact(0.2, 0.6, 0.1)
print("done")
"""


@pytest.mark.slow
@pytest.mark.parametrize("places", ["beside the source", "the user's"])
def test_it_is_compiled_once_and_says_so_at_a_terminal(places, tmp_path):
    """The second process finds what the first has cached, also where beside the source nothing may be written."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    environment |= {"XDG_CACHE_HOME": str(tmp_path), "HOME": str(tmp_path)}
    if places == "beside the source":
        environment["NUMBA_CACHE_DIR"] = str(tmp_path / "cache")
    else:
        environment["NUMBA_CACHE_LOCATOR_CLASSES"] = "UserWideCacheLocator"
    said = [
        subprocess.run([sys.executable, "-c", SCANNED], env=environment, capture_output=True, text=True, timeout=300)
        for _ in range(2)
    ]
    assert [one.stdout for one in said] == ["done\n", "done\n"], said
    first, second = (one.stderr.splitlines() for one in said)
    assert len(first) == 1
    assert "compiling the forward model" in first[0]
    assert second == []


OTHERWISE = """
import numba
numba.__version__ = "0.999.0"
import tactile_bayes as tb
from tactile_bayes.mechanics import compiler
assert "pipeline_class" not in compiler._OF_PARTS
print(*map(float, tb.mechanics.elastica.wrench_from_contact(0.2, 0.6, 0.1)))
"""


@pytest.mark.slow
def test_a_numba_that_is_not_known_compiles_the_same_by_its_public_options(tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    ran = [sys.executable, "-c", OTHERWISE]
    said = subprocess.run(ran, env=environment, capture_output=True, text=True, timeout=300, check=True).stdout
    found = [float(value) for value in said.split()]
    np.testing.assert_allclose(found, wrench_from_contact(0.2, 0.6, 0.1), rtol=1e-13)
