"""Rods of every kind, rotated and carried past objects near and far: their likelihoods, and Step 2 of their scans."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tactile_bayes as tb
from helpers.load_cells import CELL
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood
from tactile_bayes.rig import Rig

pytestmark = [
    pytest.mark.filterwarnings("ignore::tactile_bayes.errors.ClearanceWarning"),
    pytest.mark.filterwarnings("ignore::tactile_bayes.errors.StrainWarning"),
]

EXACT_CELL = tb.LoadCell(force_noise=1e-7, moment_noise=1e-7)


def drawn_rod(rng):
    """A rod that is straight, an arc, tapered, of a rigidity profile, of an uneven curvature, or traced."""
    taper = float(rng.choice([0.0, rng.uniform(0.1, 0.95)]))
    match rng.integers(6):
        case 0:
            return tb.Rod()
        case 1:
            return tb.Rod(rest_curvature=float(rng.uniform(-2.5, 2.5)))
        case 2:
            return tb.Rod(taper=float(rng.uniform(0.1, 0.95)))
        case 3:
            rate = rng.uniform(-3.0, 3.0)
            return tb.Rod(
                rigidity_profile=lambda s: np.exp(rate * s), rest_curvature=float(rng.choice([0.0, rng.uniform(-1, 1)]))
            )
        case 4:
            return tb.Rod(rest_curvature=(np.linspace(0.0, 1.0, 6), rng.uniform(-4.0, 4.0, 6)), taper=taper)
    angle = rng.uniform(-1.5, 1.5) * np.linspace(0.0, 1.0, 60) ** 2
    return tb.Rod.from_shape(np.cumsum(np.cos(angle)) / 60.0, np.cumsum(np.sin(angle)) / 60.0, taper=taper)


def drawn_scan(rng, contour_of, drive_step, highest):
    """Rod, friction, contour and the record of a scan, rotated or carried; None where there is none."""
    rod, friction = drawn_rod(rng), float(rng.choice([0.0, rng.uniform(0.0, 0.5)]))
    contour, side = contour_of(rng), float(rng.choice([-1.0, 1.0]))
    ends = side * np.array([-1.2, 1.2]), rng.uniform(-0.5, highest, 2), 0.5 * np.pi + side * rng.uniform(-1.3, 1.3, 2)
    drive = [tb.Rotation(drive_step=drive_step), tb.Motion(*ends, drive_step)][rng.integers(2)]
    try:
        scan = tb.scan(contour, drive=drive, rig=Rig(rod=rod, unknown={"friction": friction}))
    except (tb.errors.ReachError, tb.errors.ContourError):
        return None
    return rod, friction, contour, scan.record


# --- Likelihoods ----------------------------------------------------------------------------------------------------


def interpolation_error(record, friction, contour):
    """How far the log-likelihood of the true contour is from the exact one, which may be infinite."""
    one = tb.contours.Parabola(*(np.array([number]) for number in (contour.a, contour.q, contour.x_c)))
    exact, found = (
        float(RecordLikelihood(record, CELL, friction, is_exact).log_likelihood(one)[0]) for is_exact in (True, False)
    )
    return abs(found - exact) if np.isfinite(exact) else np.nan


def near_or_far(rng):
    q = np.exp(rng.uniform(np.log(0.021), np.log(0.8)))
    return tb.contours.Parabola(np.exp(rng.uniform(-2.0, 1.5)), q, rng.uniform(-0.4, 0.4))


def test_interpolation_is_not_felt_at_the_truth(fuzz_seed):
    """Log-likelihoods are within 0.05 of the exact ones."""
    rng, off = np.random.default_rng([3, fuzz_seed]), []
    while len(off) < 6:
        drawn = drawn_scan(rng, near_or_far, np.radians(3.0), -0.1)
        if drawn is None:
            continue
        _, friction, contour, record = drawn
        error = interpolation_error(CELL.measure(record, rng=rng), friction, contour)
        if np.isfinite(error):
            off.append(error)
    assert max(off) < 0.05


@pytest.mark.parametrize("q", [0.022, 0.05])
def test_loads_of_thousands_do_not_change_that(q):
    """A rod that grows stiffer toward its tip, past an object at its pivot."""
    rig = Rig(rod=tb.Rod(rigidity_profile=lambda s: 1.0 + 1.4 * s), unknown={"friction": 0.29})
    contour = tb.contours.Parabola(0.16, q, 0.17)
    record = CELL.measure(tb.scan(contour, rig=rig, drive_step=np.radians(3.0)).record, rng=1)
    assert interpolation_error(record, 0.29, contour) < 0.05


# --- Step 2 ---------------------------------------------------------------------------------------------------------


def anywhere(rng):
    return tb.contours.Parabola(np.exp(rng.uniform(-2, 2)), rng.uniform(0.05, 0.9), rng.uniform(-0.5, 0.5))


def integrated(rod, row, end):
    """Point of a rod at an arc length, and its moment there, from its wrench."""

    def value(given, s, without):
        return without if given is None else float(given(s)) if callable(given) else float(given)

    def rates(s, z):
        stiffness = (1.0 - rod.taper * s) ** 4 * value(rod.rigidity_profile, s, 1.0)
        bend = value(rod.rest_curvature, s, 0.0) + z[3] / stiffness
        force = float(row.force_y) * np.cos(z[2]) - float(row.force_x) * np.sin(z[2])
        return [np.cos(z[2]), np.sin(z[2]), bend, force]

    start = [float(row.base_x), float(row.base_y), float(row.drive_angle), -float(row.holding_moment)]
    x, y, _, moment = solve_ivp(rates, (0.0, end), start, "DOP853", rtol=1e-10, atol=1e-11, max_step=0.02).y[:, -1]
    return x, y, moment


def distance(found, record):
    """From each contact that was found to the true one; of two that are as likely, of the nearer one."""
    x, y, other_x, other_y = (
        found[f"{which}contact_{axis}"].values - record[f"truth_contact_{axis}"].values
        for which in ("", "other_")
        for axis in "xy"
    )
    doubted = np.isin(found.status.values, ["ambiguous", "either phase"])
    return np.fmin(np.hypot(x, y), np.where(doubted, np.hypot(other_x, other_y), np.inf))


def test_step_2_returns_the_contacts_of_a_scan(fuzz_seed):
    """Or says that another point is as likely, where one is."""
    rng, done, missed = np.random.default_rng([2, fuzz_seed]), 0, []
    while done < 12:
        drawn = drawn_scan(rng, anywhere, 0.08, 0.2)
        if drawn is None:
            continue
        rod, friction, _, record = drawn
        loaded = np.flatnonzero(np.hypot(record.force_x, record.force_y) > 1e-3)
        if loaded.size < 3:
            continue
        done, record = done + 1, record.isel(sample=loaded)
        rig = Rig(rod=rod, load_cell=EXACT_CELL, unknown={"friction": friction})
        for method in ("raw", "constrained"):
            found = tb.reconstruct(record, rig=rig, method=method)
            wrong = np.flatnonzero(~(distance(found, record) < 1e-5))
            missed += [(done, method, k, str(found.status.values[k])) for k in wrong]
        row = record.isel(sample=int(rng.integers(record.sizes["sample"])))
        x, y, moment = integrated(rod, row, float(row.truth_contact_arclength))
        miss = np.hypot(x - float(row.truth_contact_x), y - float(row.truth_contact_y))
        assert max(miss, abs(moment)) < 1e-6 * (1.0 + float(np.hypot(row.force_x, row.force_y)))
    assert not missed
