"""Load cells of every kind, a record to measure, and what the readings of each should be: mean and covariance."""

import numpy as np
from hypothesis import strategies as st

from tactile_bayes.load_cell import LoadCell, OrnsteinUhlenbeck, RandomWalk
from tactile_bayes.rig import Rig, make_record

CELL = LoadCell(force_noise=0.05, moment_noise=0.02)
WALK = RandomWalk(moment=0.015, force=0.03)
WANDER = OrnsteinUhlenbeck(moment=0.03, force=0.02, time=2.5)
SHARED = (0.6, -0.3, 0.2)
UNKNOWN = (0.05, 0.02, 0.1)
GAIN = ((1.02, 0.01, 0.0), (-0.02, 0.97, 0.03), (0.0, 0.02, 1.05))


def cell(**options) -> LoadCell:
    """`CELL` with more to it."""
    return LoadCell(**{"force_noise": 0.05, "moment_noise": 0.02, **options})


# Every combination of which the likelihood is that of a normal distribution.
NORMAL = {
    "white": CELL,
    "gain and bias": cell(gain=GAIN, bias=(0.1, -0.2, 0.3)),
    "lever": cell(gain=GAIN, lever=(0.1, -0.2), relative_noise=0.2),
    "curve": cell(gain=GAIN, lever=(0.1, -0.2), moment_curve=(0.3, 0.1), bias=(0.1, -0.2, 0.3)),
    "memory": cell(gain=GAIN, lever=(0.1, -0.2), lag=0.7, play=0.1, bias=(0.1, -0.2, 0.3)),
    "memory of channels": cell(gain=GAIN, lag=(0.7, 0.0, 2.0), play=(0.1, 0.3, 0.0)),
    "lag, relative, drift": cell(lag=3.0, relative_noise=0.2, drift=WALK),
    "curve, relative": cell(moment_curve=(-0.2, 0.05), relative_noise=0.2),
    "relative noise": cell(relative_noise=0.2, gain=GAIN, bias=(0.1, -0.2, 0.3)),
    "random walk": cell(drift=WALK),
    "drift of the forces": cell(drift=RandomWalk(force=0.03)),
    "drift that forgets": cell(drift=WANDER),
    "unknown bias": cell(bias_uncertainty=UNKNOWN),
    "unknown bias of one": cell(bias_uncertainty=(0.0, 0.1, 0.0)),
    "correlated": cell(correlation=SHARED),
    "correlated, relative": cell(correlation=SHARED, relative_noise=0.2),
    "correlated random walk": cell(correlation=SHARED, drift=WALK, gain=GAIN),
    "correlated drift that forgets": cell(correlation=SHARED, drift=WANDER),
    "correlated, unknown bias": cell(correlation=SHARED, bias_uncertainty=UNKNOWN),
    "random walk from an unknown bias": cell(drift=WALK, bias_uncertainty=UNKNOWN),
    "drift that forgets, unknown bias": cell(drift=WANDER, bias_uncertainty=(0.05, 0.0, 0.1)),
    "drift, relative noise": cell(drift=WALK, bias_uncertainty=UNKNOWN, relative_noise=0.2),
    "drift that forgets, relative": cell(drift=WANDER, bias_uncertainty=UNKNOWN, relative_noise=0.2),
}


def moments(sheet: LoadCell, loads, noise_scale=(1.0, 1.0, 1.0)):
    """Mean, shape (3n,), and covariance of readings of loads (n, 3), sample by sample, written out."""
    n = len(loads)
    loads = np.array(loads, dtype=float)
    left = [np.exp(-1.0 / lag) if lag else 0.0 for lag in np.full(3, sheet.lag)]
    for k in range(1, n):
        loads[k] += left * (loads[k - 1] - loads[k])
    half, now = np.full(3, sheet.play) * np.abs(loads).max(axis=0), np.zeros(3)
    for k, c in np.ndindex(loads.shape):
        loads[k, c] = now[c] = min(max(now[c], loads[k, c] - half[c]), loads[k, c] + half[c])
    x, y = sheet.lever
    quadratic, cubic = sheet.moment_curve
    at_lever = [(moment - x * force_y + y * force_x, force_x, force_y) for moment, force_x, force_y in loads]
    at_lever = [(m + quadratic * m**2 + cubic * m**3, force_x, force_y) for m, force_x, force_y in at_lever]
    weighed = np.array([np.array(sheet.gain) @ load for load in at_lever])
    white = np.array([sheet.moment_noise, sheet.force_noise, sheet.force_noise])
    white = np.sqrt(white**2 + (sheet.relative_noise * weighed) ** 2) * np.asarray(noise_scale)
    between = np.eye(3)
    between[[0, 0, 1], [1, 2, 2]] = between[[1, 2, 2], [0, 0, 1]] = sheet.correlation
    step = np.array([sheet.moment_resolution, sheet.force_resolution, sheet.force_resolution])
    covariance = np.zeros((n, 3, n, 3))
    for i in range(n):
        covariance[i, :, i, :] = np.outer(white[i], white[i]) * between + np.diag(step**2 / 12)
        for j in range(n):
            for c in range(3):
                covariance[i, c, j, c] += sheet.bias_uncertainty[c] ** 2
                if sheet.drift is not None:
                    size = (sheet.drift.moment, sheet.drift.force, sheet.drift.force)[c]
                    walk = isinstance(sheet.drift, RandomWalk)
                    together = min(i, j) if walk else np.exp(-abs(i - j) / sheet.drift.time)
                    covariance[i, c, j, c] += size**2 * together
    return (weighed + sheet.bias).ravel(), covariance.reshape(3 * n, 3 * n)


def ideal(samples=5, missing=(), rod=None, **further):
    """A sweep without noise."""
    table = {
        "sweep": 0,
        "direction": "forward",
        "drive_angle": np.linspace(1.0, 2.0, samples),
        "holding_moment": np.linspace(0.0, 0.5, samples),
        "force_x": np.linspace(0.0, -0.25, samples),
        "force_y": np.linspace(0.0, 2.0, samples),
        **further,
    }
    return make_record({k: v for k, v in table.items() if k not in missing}, Rig(rod=rod, file={"missing": missing}))


# ---- for hypothesis to draw

_sizes = st.one_of(st.just(0.0), st.floats(1e-3, 1.0))
_of_channels = st.one_of(_sizes, st.tuples(_sizes, _sizes, _sizes))
_signed = st.floats(-1.0, 1.0)
_drifts = st.one_of(
    st.none(), st.builds(RandomWalk, _sizes, _sizes), st.builds(OrnsteinUhlenbeck, _sizes, _sizes, st.floats(0.1, 1e3))
)


@st.composite
def load_cells(draw, frames=(None, "fixed", "turning")) -> LoadCell:
    """Load cells with any flaws."""
    outliers = draw(st.booleans())
    correlation = draw(st.one_of(st.just((0.0, 0.0, 0.0)), st.tuples(*[st.floats(-0.45, 0.45)] * 3)))
    cross = draw(st.one_of(st.just([0.0] * 9), st.lists(st.floats(-0.2, 0.2), min_size=9, max_size=9)))
    return LoadCell(
        force_noise=draw(st.floats(1e-3, 1.0)),
        moment_noise=draw(st.floats(1e-3, 1.0)),
        degrees_of_freedom=draw(st.floats(1.0, 100.0)) if outliers else np.inf,
        relative_noise=draw(_sizes),
        correlation=(0.0, 0.0, 0.0) if outliers else correlation,
        bias=draw(st.tuples(_signed, _signed, _signed)),
        bias_uncertainty=draw(st.one_of(st.just((0.0, 0.0, 0.0)), st.tuples(_sizes, _sizes, _sizes))),
        drift=draw(_drifts),
        gain=np.eye(3) + np.reshape(cross, (3, 3)),
        lever=draw(st.one_of(st.just((0.0, 0.0)), st.tuples(_signed, _signed))),
        moment_curve=draw(st.one_of(st.just((0.0, 0.0)), st.tuples(_signed, _signed))),
        lag=draw(_of_channels),
        play=draw(_of_channels),
        force_range=draw(st.one_of(st.just(np.inf), st.floats(1.0, 3.0))),
        moment_range=draw(st.one_of(st.just(np.inf), st.floats(1.0, 3.0))),
        force_resolution=draw(_sizes),
        moment_resolution=draw(_sizes),
        drive_angle_offset=draw(st.floats(-0.1, 0.1)),
        drive_angle_backlash=draw(st.floats(-0.01, 0.01)),
        drive_angle_noise=0.01 * draw(_sizes),
        drive_angle_resolution=0.01 * draw(_sizes),
        frame=draw(st.sampled_from(frames)),
    )
