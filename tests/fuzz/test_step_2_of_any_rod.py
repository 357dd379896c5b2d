"""Step 2 of rods of every kind, from what their scans record, and against an independent integration."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tactile_bayes as tb
from helpers.rods_drawn import drawn_rod
from tactile_bayes.rig import Rig

CELL = tb.LoadCell(force_noise=1e-7, moment_noise=1e-7)
SCENES = 12


def drawn_record(rng):
    """Rod, friction and the loaded samples of a scan; None where there is none."""
    rod, friction = drawn_rod(rng), float(rng.choice([0.0, rng.uniform(0.0, 0.5)]))
    contour = tb.contours.Parabola(np.exp(rng.uniform(-2, 2)), rng.uniform(0.05, 0.9), rng.uniform(-0.5, 0.5))
    side = float(rng.choice([-1.0, 1.0]))
    drive = tb.Motion(
        side * np.array([-1.2, 1.2]), rng.uniform(-0.5, 0.2, 2), 0.5 * np.pi + side * rng.uniform(-1.3, 1.3, 2), 0.08
    )
    try:
        record = tb.scan(
            contour,
            drive=[tb.Rotation(drive_step=0.08), drive][rng.integers(2)],
            rig=Rig(rod=rod, unknown={"friction": friction}),
        ).record
    except (tb.errors.ReachError, tb.errors.ContourError):
        return None
    force = np.hypot(record.force_x, record.force_y).values
    if np.count_nonzero(force > 1e-3) < 3:
        return None
    return rod, friction, record.isel(sample=np.flatnonzero(force > 1e-3))


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


@pytest.mark.filterwarnings("ignore::tactile_bayes.errors.ClearanceWarning")
@pytest.mark.filterwarnings("ignore::tactile_bayes.errors.StrainWarning")
def test_step_2_returns_the_contacts_of_a_scan(fuzz_seed):
    """Or says that another point is as likely, where one is."""
    rng, done, missed = np.random.default_rng([2, fuzz_seed]), 0, []
    while done < SCENES:
        drawn = drawn_record(rng)
        if drawn is None:
            continue
        rod, friction, record = drawn
        done += 1
        for method in ("raw", "constrained"):
            found = tb.reconstruct(
                record, rig=Rig(rod=rod, load_cell=CELL, unknown={"friction": friction}), method=method
            )
            x, y = (found[f"contact_{axis}"].values - record[f"truth_contact_{axis}"].values for axis in "xy")
            x_other, y_other = (
                found[f"other_contact_{axis}"].values - record[f"truth_contact_{axis}"].values for axis in "xy"
            )
            doubted = np.isin(found.status.values, ["ambiguous", "either phase"])
            error = np.fmin(np.hypot(x, y), np.where(doubted, np.hypot(x_other, y_other), np.inf))
            missed += [(done, method, k, str(found.status.values[k])) for k in np.flatnonzero(~(error < 1e-5))]
        row = record.isel(sample=int(rng.integers(record.sizes["sample"])))
        x, y, moment = integrated(rod, row, float(row.truth_contact_arclength))
        miss = np.hypot(x - float(row.truth_contact_x), y - float(row.truth_contact_y))
        assert max(miss, abs(moment)) < 1e-6 * (1.0 + float(np.hypot(row.force_x, row.force_y)))
    assert not missed
