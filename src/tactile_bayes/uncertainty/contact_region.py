"""The region in which a contact lies with a given probability, whatever its shape."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy.spatial.distance import cdist

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.checks import check_probability, check_whole_number
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.inference.result import contact_draws
from tactile_bayes.numerics.blocks import blocks
from tactile_bayes.uncertainty.contact_moments import LEAST_DRAWS


@dataclass(frozen=True, eq=False)
class ContactRegion:
    """Highest-density region of a contact point: the smallest region of its probability.

    The density is a kernel density estimate from the draws, with a normal kernel of the draws' covariance and the
    bandwidth n^(−1/6) of Scott's rule in two dimensions. The share of draws in the region, at each of which the density
    leaves that draw out, is its probability.
    """

    probability: float
    draws: Floats  # contact points, shape (n, 2), in the record's unit of length
    level: float  # density on the boundary, in arbitrary units; see `density`
    _of_draws: Floats  # densities at the draws, increasing
    _scaling: Floats  # makes the kernel a unit normal one

    def __repr__(self) -> str:
        return f"ContactRegion(probability={self.probability:g}, {len(self.draws)} draws)"

    def density(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Return the density at points, in the units of `level`; the shape is that of x and y, broadcast."""
        x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        at = np.stack([x.ravel(), y.ravel()], axis=-1) @ self._scaling
        return _kernel_sums(at, self.draws @ self._scaling).reshape(x.shape) / len(self.draws)

    def contains(self, x: ArrayLike, y: ArrayLike) -> Flags:
        """Return True for points in the region, False for others and for NaN; shape as of x and y, broadcast."""
        return np.asarray(self.density(x, y) >= self.level)

    def least_probability(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Return the probability of the smallest highest-density region that holds each point; NaN for NaN.

        For correct posteriors, the probabilities of the true contacts are uniform between 0 and 1.
        """
        density = self.density(x, y)
        denser = self._of_draws.size - np.searchsorted(self._of_draws, density, side="left")
        return np.where(np.isnan(density), np.nan, denser / self._of_draws.size)

    def grid(self, points: int = 80) -> tuple[Floats, Floats, Floats]:
        """Return x, y and density on a grid over the region, shapes (points,), (points,) and (points, points)."""
        margin = 3.0 * len(self.draws) ** (-1.0 / 6.0) * self.draws.std(axis=0)
        low, high = self.draws.min(axis=0) - margin, self.draws.max(axis=0) + margin
        x, y = (np.linspace(low[i], high[i], points) for i in (0, 1))
        return x, y, self.density(*np.meshgrid(x, y))


def contact_region(posterior: xr.DataTree | xr.Dataset, sample: int, probability: float = 0.9) -> ContactRegion:
    """Return the region of the plane in which a contact point lies with a given probability.

    Parameters
    ----------
    posterior : xr.DataTree
        From `infer_contacts` or `implied_contacts`.
    sample : int
        Label of the contact in the coordinate "sample".
    probability : float
        Probability of the region, in (0, 1).

    Returns
    -------
    ContactRegion
        In the record's unit of length. `contains` tests points, `least_probability` returns the probability of the
        smallest region that holds a point, and `grid` serves for drawing.

    Raises
    ------
    ParameterError, InferenceError
        If the probability is not in (0, 1), or there is no such sample; if the sample has no contact, or this is no
        result of `infer_contacts` or `implied_contacts`.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> x, y = ((("chain", "draw", "sample"), rng.normal(size=(4, 500, 1))) for _ in range(2))
    >>> region = contact_region(xr.Dataset({"contact_x": x, "contact_y": y}, coords={"sample": [7]}), sample=7)
    >>> region.contains([0.0, 1.8, 2.6], 0.0)  # the circle has a radius of 2.15
    array([ True,  True, False])
    """
    check_probability("probability", probability, "give a number between 0 and 1, like 0.9")
    draws = contact_draws(posterior)
    check_whole_number("sample", sample, 0, "give the number of a sample")
    if sample not in draws["sample"].values:
        low, high = draws["sample"].values.min(), draws["sample"].values.max()
        raise ParameterError(f"there is no sample {sample!r}: the posterior has {low} to {high}")
    of_sample = draws.sel(sample=sample)
    points = np.stack([of_sample["contact_x"].values.ravel(), of_sample["contact_y"].values.ravel()], axis=-1)
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) < LEAST_DRAWS:
        raise InferenceError(f"sample {sample} has no contact: its posterior has no draws")
    variances, axes = np.linalg.eigh(np.cov(points.T))
    scaling = axes / np.sqrt(np.maximum(variances, 1e-30)) * len(points) ** (1.0 / 6.0)
    scaled = points @ scaling
    others = np.sort((_kernel_sums(scaled, scaled) - 1.0) / (len(points) - 1))
    return ContactRegion(probability, points, float(np.quantile(others, 1.0 - probability)), others, scaling)


def _kernel_sums(at: Floats, centres: Floats) -> Floats:
    """Return the sum of unit normal kernels around centres (n, 2) at points (m, 2); a kernel is 1 at its centre."""
    parts = blocks(len(at), len(centres))
    return np.concatenate([np.exp(-0.5 * cdist(at[part], centres, "sqeuclidean")).sum(axis=1) for part in parts])
