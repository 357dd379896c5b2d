"""What a scan hands out, checked by an integration of the rod that shares no code with the library."""

import numpy as np

import tactile_bayes as tb
from helpers.rest_lines import depth, rest_line
from tactile_bayes.sweep.scanning import Scan

_TOLERANCE = 1e-6  # of places [L] and moments
_STEPS, _EVERY = 200, 4  # steps of an integration, and the share of the samples whose rods are compared with the object


def _fields(rod: tb.Rod, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rest curvature and flexural rigidity at arc lengths, of a rod of length and rigidity one."""
    curvature = rod.rest_curvature
    rest = curvature(s) if callable(curvature) else np.full_like(s, float(curvature))
    return rest, (1.0 - rod.taper * s) ** 4


def _rates(rod: tb.Rod, s: np.ndarray, state: np.ndarray, wrench: np.ndarray) -> np.ndarray:
    """x', y', φ' of a loaded rod: EI (φ' − κ0) = −m0 + fAy x − fAx y."""
    (x, y, phi), (moment, force_x, force_y) = state, wrench
    rest, rigidity = _fields(rod, s)
    return np.stack([np.cos(phi), np.sin(phi), rest + (force_y * x - force_x * y - moment) / rigidity])


def _integrated(rod: tb.Rod, begin: np.ndarray, end: np.ndarray, state: np.ndarray, wrench: np.ndarray) -> np.ndarray:
    """Points and slopes from one arc length to another by Runge and Kutta's method, shape (steps + 1, 3, n)."""
    h, found = (end - begin) / _STEPS, [state]
    for k in range(_STEPS):
        s, z = begin + k * h, found[-1]
        one = _rates(rod, s, z, wrench)
        two = _rates(rod, s + 0.5 * h, z + 0.5 * h * one, wrench)
        three = _rates(rod, s + 0.5 * h, z + 0.5 * h * two, wrench)
        four = _rates(rod, s + h, z + h * three, wrench)
        found.append(z + h / 6.0 * (one + 2.0 * two + 2.0 * three + four))
    return np.array(found)


def violations(scan: Scan, rod: tb.Rod, friction: float) -> dict[str, float]:
    """Largest violations of each condition that is not met, over all samples of a scan of one sweep.

    "residual": the rod under the recorded wrench does not end at the recorded contact. "cone": the force is beyond the
    cone of friction, or inside it between two samples that slip [L]. "sense": friction pushes on the slip [L].
    "inside": the rod lies in the object.
    """
    record, backward = scan.record, scan.sweeps[0].direction == "backward"
    mirror = -1.0 if backward else 1.0
    found: dict[str, float] = {}

    def note(name: str, value: float, allowed: float) -> None:
        if not value <= allowed:
            found[name] = max(value, found.get(name, 0.0))

    loaded = record.truth_contact_phase.values != "none"
    columns = {name: record[name].values for name in record.data_vars}
    idle = np.flatnonzero(~loaded)[::_EVERY]
    for x, y, angle in zip(*(columns[name][idle] for name in ("base_x", "base_y", "drive_angle")), strict=True):
        note("inside, unloaded", depth(scan.contour, *rest_line(rod, x, y, angle)), 10.0 * _TOLERANCE)
    on = {name: values[loaded] for name, values in columns.items()}
    if not loaded.any():
        return found
    wrench = np.stack([on["holding_moment"], on["force_x"], on["force_y"]])
    s1, stem = on["truth_contact_arclength"], rod.stem
    angle = on["drive_angle"]
    start = np.stack([stem * np.cos(angle), stem * np.sin(angle), angle])
    bent = _integrated(rod, np.zeros_like(s1), s1, start, wrench)
    free = _integrated(rod, s1, np.ones_like(s1), bent[-1], np.zeros_like(wrench))
    standoff = 0.5 * rod.diameter * (1.0 - rod.taper * s1) if rod.diameter else np.zeros_like(s1)
    half_angle = np.arctan(0.5 * rod.diameter * rod.taper)
    standoff = standoff * np.cos(half_angle)
    alpha = on["truth_slope_angle"]
    px = on["truth_contact_x"] + standoff * np.sin(alpha) - on["base_x"]
    py = on["truth_contact_y"] - standoff * np.cos(alpha) - on["base_y"]
    moment_left = wrench[2] * bent[-1, 0] - wrench[1] * bent[-1, 1] - wrench[0]
    miss = np.maximum(np.hypot(bent[-1, 0] - px, bent[-1, 1] - py), np.abs(moment_left))
    note("residual", float(miss.max()), _TOLERANCE)
    lying = on["truth_contact_phase"] == "tangential"
    across = bent[-1, 2] - (np.pi if backward else 0.0) - alpha - mirror * half_angle
    off = np.abs((across[lying] + np.pi) % (2.0 * np.pi) - np.pi)
    note("residual", float(off.max(initial=0.0)), _TOLERANCE)
    # Force and slip in the frame of a forward sweep.
    force = np.hypot(wrench[1], wrench[2])
    felt = force > 1e-6
    inclined = mirror * (np.arctan2(-wrench[1], wrench[2]) - alpha)
    within = np.arctan(friction) - np.abs(inclined)
    note("cone", float(-within[felt].min(initial=0.0)), 1e-6)
    moved = mirror * np.diff(px + on["base_x"]) * np.cos(0.5 * (alpha[1:] + alpha[:-1]))
    moved += mirror * np.diff(py + on["base_y"]) * np.sin(0.5 * (alpha[1:] + alpha[:-1]))
    slip = moved - np.where(lying[1:], np.diff(s1), 0.0)
    edge = within < 1e-7
    same = (lying[1:] == lying[:-1]) & felt[1:] & felt[:-1] & (friction > 0.0)
    steady = same & edge[1:] & edge[:-1] & (inclined[1:] * inclined[:-1] > 0.0)
    note("sense", float((np.sign(inclined[1:]) * slip)[steady].max(initial=0.0)), 1e-7)
    note("cone", float(np.abs(slip[same & ~edge[1:] & ~edge[:-1]]).max(initial=0.0)), 1e-7)
    for part, begin, end in ((bent, 0.0 * s1, s1), (free, s1, np.ones_like(s1))):
        s = begin + (end - begin) * np.linspace(0.0, 1.0, _STEPS + 1)[:, None]
        half = 0.5 * rod.diameter * (1.0 - rod.taper * s)
        for k in range(0, s1.size, _EVERY):
            at = part[:, 0, k] + on["base_x"][k], part[:, 1, k] + on["base_y"][k]
            note("inside, loaded", depth(scan.contour, *at, half[:, k]), 20.0 * _TOLERANCE + 1e-3 * rod.diameter)
    return found
