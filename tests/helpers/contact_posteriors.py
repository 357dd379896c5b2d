"""Posteriors of single contacts by brute force: sums over the space of (contact_x, contact_y, slope_angle).

The likelihood is written out with scipy.stats, the rod is asked by `wrench_from_contact`, and nothing is known of
sheets, coordinates or proposals. A sum has one random point in every cell of a regular grid, whose places and extent
are found by coarse sums at first for much larger noise: errors are random, and smaller than those of a regular grid at
the edges where the density jumps.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
import xarray as xr
from scipy import stats

import tactile_bayes as tb
from tactile_bayes.contours import Parabola, paper_profile
from tactile_bayes.inference.contact_posterior.density import ContactDensity
from tactile_bayes.inference.contact_posterior.draws import weigh_contacts
from tactile_bayes.load_cell import LoneSamples
from tactile_bayes.mechanics.elastica import wrench_from_contact
from tactile_bayes.mechanics.phases import NONE, TANGENTIAL, TIP
from tactile_bayes.reconstruction import samples_of
from tactile_bayes.record import frame_of, in_frame, loads_of, rod_of

NAMES = ("contact_x", "contact_y", "slope_angle")

CELL = tb.LoadCell(force_noise=0.05, moment_noise=0.02, drive_angle_noise=0.01)
EXACT_ANGLE = tb.LoadCell(force_noise=0.05, moment_noise=0.02)
ROD = tb.Rod(length=0.1, flexural_rigidity=1.2e-5, diameter=0.003)
SUMS, REACH = 4, 6.0  # number of independent sums, and extent of their grids [standard deviations]
SI_CELL = tb.LoadCell(force_noise=0.05 * ROD.force_unit, moment_noise=0.02 * ROD.moment_unit, drive_angle_noise=0.01)


@cache
def measured(kind: str = "plain") -> xr.Dataset:
    """Profile II at q = 0.5, both sweeps; "exact angle", "SI" with a rod that has a diameter, or in a "turning" frame.

    Not to be changed.
    """
    if kind == "SI":
        return SI_CELL.measure(
            tb.scan(Parabola(5.0, q=0.05), rig=tb.Rig(rod=ROD), drive_step=0.05, base=(0.01, 0.002)).record, rng=3
        )
    record = tb.scan(paper_profile("II", q=0.5), drive_step=0.05).record
    if kind == "turning":
        record = in_frame(record, "turning")
    return (EXACT_ANGLE if kind == "exact angle" else CELL).measure(record, rng=1 if kind == "plain" else 2)


@dataclass(frozen=True)
class Summary:
    """Moments of a posterior over (contact_x, contact_y, slope_angle), dimensionless for a rod of length one.

    `spread` holds, number by number, the standard deviation of what one independent draw contributes to it: over the
    root of the number of draws, that is the Monte-Carlo error of the same number from draws.
    """

    mean: np.ndarray
    sd: np.ndarray
    correlation: np.ndarray  # of x and y, x and slope, y and slope
    tangential: float
    spread: np.ndarray
    error: np.ndarray  # of the numbers themselves, from the scatter of independent sums

    @property
    def numbers(self) -> np.ndarray:
        """Means, logarithms of standard deviations, correlations, probability of tangential contact."""
        return np.concatenate([self.mean, np.log(self.sd), self.correlation, [self.tangential]])


def moments(points, weight, tangential):
    """The ten numbers from weighted points (n, 3), with what one draw contributes to each."""
    weight = weight / weight.sum()
    mean = weight @ points
    off = points - mean
    sd = np.sqrt(weight @ off**2)
    z = off / sd
    pairs = ((0, 1), (0, 2), (1, 2))
    first, second = (z[:, list(of)] for of in zip(*pairs, strict=True))
    rho, share = weight @ (first * second), weight @ tangential
    on_rho = first * second - 0.5 * rho * (first**2 + second**2)
    influence = [off, 0.5 * (z**2 - 1.0), on_rho, (tangential - share)[:, None]]
    spread = np.sqrt(weight @ np.concatenate(influence, axis=1) ** 2)
    return np.concatenate([mean, np.log(sd), rho, [share]]), spread


class Sample:
    """One sample of a record, dimensionless and relative to the pivot, and how likely contacts make it."""

    def __init__(self, record: xr.Dataset, i: int, cell: tb.LoadCell, friction: float = 0.0) -> None:
        rod = rod_of(record)
        self.length, self.radius = rod.length_unit, 0.5 * rod.diameter / rod.length_unit
        self.base = np.array([record.base_x.values[i], record.base_y.values[i]]) / self.length
        units = rod.load_units
        self.loads = np.array([record[n].values[i] for n in ("holding_moment", "force_x", "force_y")]) / units
        self.noise = np.array([cell.moment_noise, cell.force_noise, cell.force_noise]) / units
        self.angle, self.angle_noise = float(record.drive_angle.values[i]), cell.drive_angle_noise
        self.side = -1 if record.direction.values[i] == "backward" else 1
        self.turning = frame_of(record) == "turning"
        self.friction_angle = float(np.arctan(friction))

    def wrench(self, x, y, slope):
        return wrench_from_contact(x, y, slope, self.friction_angle, side=self.side)

    def log_loads(self, wrench, angle, widening=1.0):
        """Of the three loads; the forces are read in the axes of the rod where the cell turns with it."""
        fx, fy = wrench.force_x, wrench.force_y
        if self.turning:
            fx, fy = fx * np.cos(angle) + fy * np.sin(angle), fy * np.cos(angle) - fx * np.sin(angle)
        logs = sum(
            stats.norm.logpdf(reading, value, widening * noise)
            for reading, value, noise in zip(self.loads, (wrench.holding_moment, fx, fy), self.noise, strict=True)
        )
        return np.where(wrench.phase == NONE, -np.inf, logs)

    def log_likelihood(self, points, widening=1.0, angle_noise=None):
        """Log-density of loads and drive angle, and the phase, for points (n, 3)."""
        wrench = self.wrench(*points.T)
        noise = self.angle_noise if angle_noise is None else angle_noise
        logs = self.log_loads(wrench, wrench.drive_angle, widening)
        logs = logs + stats.norm.logpdf(self.angle, wrench.drive_angle, widening * noise)
        inside = np.abs(points[:, 2]) < 0.5 * np.pi
        return np.where(inside & ~np.isnan(logs), logs, -np.inf), wrench.phase

    def surface(self, points):
        """Points on the object's surface, in the record's unit, from those of the rod's centreline."""
        x, y, slope = points.T
        x = x - self.radius * np.sin(slope) + self.base[0]
        y = y + self.radius * np.cos(slope) + self.base[1]
        return np.stack([x * self.length, y * self.length, slope], axis=-1)


def _jittered(rng, cells):
    """One random point in every cell of a grid over [-REACH, REACH]^d, shape (product of cells, d)."""
    corners = np.stack(np.meshgrid(*(np.arange(n) for n in cells), indexing="ij"), axis=-1).reshape(-1, len(cells))
    return REACH * (2.0 * (corners + rng.random(corners.shape)) / np.array(cells) - 1.0)


def contact_points(polar):
    """(x, y, slope angle) from (ρ, ϑ, slope angle), for points a distance √(1 − ρ²) from the pivot, and log-volume.

    The load of a tip contact is proportional to ρ where it is small, and it is a thin shell in x and y: in these
    coordinates a grid has points in it. dx dy = r dr dϑ = ρ dρ dϑ.
    """
    rho, theta, slope = polar.T
    inside = (rho > 0.0) & (rho < 1.0) & (np.abs(slope) < 0.5 * np.pi)
    distance = np.sqrt(1.0 - np.where(inside, rho, 0.5) ** 2)
    points = np.stack([distance * np.cos(theta), distance * np.sin(theta), slope], axis=-1)
    return points, np.log(np.where(inside, rho, 1.0)) + np.where(inside, 0.0, -np.inf)


def located(sample: Sample, phase, rng, angle_noise=None, log_prior=None):
    """Mean and root of the covariance of one phase's part in (ρ, ϑ, slope), or None if there is no such contact.

    From sums for noise that shrinks to its size.
    """
    centre, root = np.array([0.5, 0.5 * np.pi, 0.0]), np.diag([0.5, 0.5 * np.pi, 0.5 * np.pi]) / REACH
    widening = 64.0
    while True:
        for _ in range(2):
            polar = centre + _jittered(rng, (24,) * 3) @ root.T
            points, volume = contact_points(polar)
            logs, found = sample.log_likelihood(points, widening, angle_noise)
            logs = np.where(found == phase, logs + volume, -np.inf)
            if log_prior is not None:
                logs = logs + log_prior(*sample.surface(points).T)
            if not np.isfinite(logs).any():
                return None
            weight = np.exp(logs - logs.max())
            weight /= weight.sum()
            centre = weight @ polar
            root = np.linalg.cholesky((polar - centre).T @ ((polar - centre) * weight[:, None]) + 1e-14 * np.eye(3))
        if widening == 1.0:
            return centre, root
        widening /= 2.0


def _by_phase(sample, one_sum, **options) -> Summary:
    """Each phase has a grid of its own: in weak contacts one of them is a thin layer beside the other."""
    rng, parts = np.random.default_rng(1), [[] for _ in range(SUMS)]
    for phase in (TIP, TANGENTIAL):
        place = located(sample, phase, rng, **options)
        for part in parts if place is not None else []:
            surface, logs, found = one_sum(rng, *place)
            part.append((surface, np.where(found == phase, logs, -np.inf), found == TANGENTIAL))
    return _summary([tuple(np.concatenate(column) for column in zip(*part, strict=True)) for part in parts])


def posterior(sample: Sample, *, log_prior=None, cells=26) -> Summary:
    """Over the three dimensions of contacts, with an encoder that is not exact; prior flat or as given."""

    def one_sum(rng, centre, root):
        points, volume = contact_points(centre + _jittered(rng, (cells,) * 3) @ root.T)
        logs, found = sample.log_likelihood(points)
        surface, logs = sample.surface(points), logs + volume + np.log(np.diag(root)).sum()
        if log_prior is not None:
            logs = logs + log_prior(*surface.T)
        return surface, logs, found

    return _by_phase(sample, one_sum, log_prior=log_prior)


def posterior_at_exact_angle(sample: Sample, *, cells=100) -> Summary:
    """Over the surface of contacts with the drive angle that was read, a grid over ρ and slope − ϑ.

    When contact point and slope are turned about the pivot, the drive angle turns with them: ∂φ0/∂ϑ = 1 at a given
    slope − ϑ, and the flat prior on the surface is ρ dρ d(slope − ϑ).
    """
    to_plane = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 1.0]])

    def one_sum(rng, centre, root):
        plane = np.linalg.cholesky(to_plane @ root @ root.T @ to_plane.T)
        rho, lean = (to_plane @ centre + _jittered(rng, (cells, cells)) @ plane.T).T
        somewhere = np.stack([rho, np.full(rho.size, centre[1]), centre[1] + lean], axis=-1)
        there = sample.wrench(*contact_points(somewhere)[0].T).drive_angle
        turn = np.where(np.isnan(there), 0.0, sample.angle - there)
        points, volume = contact_points(somewhere + turn[:, None] * [0.0, 1.0, 1.0])
        wrench = sample.wrench(*points.T)
        logs = sample.log_loads(wrench, sample.angle) + volume + np.log(np.diag(plane)).sum()
        logs[np.isnan(there) | np.isnan(logs)] = -np.inf
        return sample.surface(points), logs, wrench.phase

    return _by_phase(sample, one_sum, angle_noise=2e-3)


def _summary(parts) -> Summary:
    top = max(logs.max() for _, logs, _ in parts)
    parts = [(points, np.exp(logs - top), lies.astype(float)) for points, logs, lies in parts]
    # Points of no weight are many.
    parts = [tuple(column[weight > 1e-14] for column in (points, weight, lies)) for points, weight, lies in parts]
    numbers, spread = moments(*(np.concatenate(column) for column in zip(*parts, strict=True)))
    each = np.array([moments(*part)[0] for part in parts])
    error = each.std(axis=0, ddof=1) / np.sqrt(len(parts))
    return Summary(numbers[:3], np.exp(numbers[3:6]), numbers[6:9], numbers[9], spread, error)


def density_of(record: xr.Dataset, cell: tb.LoadCell, which, *, prior="flat", friction=0.0) -> ContactDensity:
    """The package's own density of some samples."""
    samples, rod = samples_of(record, cell), rod_of(record)
    units = rod.load_units
    readings = LoneSamples(cell.dimensionless(rod), loads_of(record) / units)
    base = np.stack([record.base_x.values, record.base_y.values], axis=-1)
    options = {"turning": frame_of(record) == "turning", "friction": friction, "prior": prior}
    return ContactDensity(samples, readings, base, **options).take(np.atleast_1d(which))


def weighed_moments(density: ContactDensity):
    """The ten numbers of each sample from weighted proposals, and the number of draws that these are worth."""
    weights = weigh_contacts(density, 16_000, np.random.SeedSequence(1))
    coordinates, _ = density.unfold(weights.points.swapaxes(1, 2))
    places, tangential = density.contacts(coordinates)[:3], weights.points[:, 0] < 0.0
    each = []
    for i, log_weight in enumerate(weights.log_weight.T):
        used = log_weight > -60.0
        each.append(moments(places[:, used, i].T, np.exp(log_weight[used]), tangential[used, i])[0])
    return np.array(each), weights
