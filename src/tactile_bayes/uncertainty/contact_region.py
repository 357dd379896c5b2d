"""The region in which a contact lies with a given probability, whatever its shape."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy.spatial.distance import cdist

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.checks import check_probability, check_whole_number
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.inference.result import contact_draws
from tactile_bayes.mechanics.phases import NONE, PHASE_NAMES, TANGENTIAL, TIP
from tactile_bayes.numerics.blocks import blocks
from tactile_bayes.reconstruction.estimate import spread_across

_DRAWS = ("chain", "draw")
LEAST_DRAWS = 10  # smallest number of draws in contact from which a standard deviation is computed


def contact_moments(posterior: xr.DataTree | xr.Dataset) -> xr.Dataset:
    """Return means, standard deviations and correlations of contacts, in the variables of `reconstruct`.

    Parameters
    ----------
    posterior : xr.DataTree
        From `infer_contacts` or `implied_contacts`.

    Returns
    -------
    xr.Dataset
        Over "sample", from the draws in contact: means contact_x, contact_y, contact_arclength [length] and slope_angle
        [rad] with their standard deviations (`contact_x_sd`, …); contact_xy_correlation; tangent_sd and normal_sd,
        along the contour and across it [length]; contact_phase, the more probable phase; contact_probability, the
        share of draws in contact. NaN where fewer than 10 draws are in contact.

    Raises
    ------
    InferenceError
        If the argument is not a result of `infer_contacts` or `implied_contacts`.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> names = {"contact_x": 0.03, "contact_y": 0.01, "slope_angle": 0.1, "contact_arclength": 0.1, "tangential": 0.0}
    >>> draws = {name: (("chain", "draw", "sample"), sd * rng.normal(size=(4, 250, 1))) for name, sd in names.items()}
    >>> moments = contact_moments(xr.Dataset(draws, coords={"sample": [0]}))
    >>> moments.tangent_sd.values.round(3), moments.normal_sd.values.round(3)
    (array([0.03]), array([0.01]))
    """
    draws = contact_draws(posterior).transpose(*_DRAWS, "sample", ...)
    number = draws["contact_x"].notnull().sum(_DRAWS)
    enough = number >= LEAST_DRAWS
    variables: dict[str, Any] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a sample without a draw in contact
        for name in ("contact_x", "contact_y", "slope_angle", "contact_arclength"):
            attrs = draws[name].attrs
            spread = f"standard deviation of the {attrs.get('long_name', name.replace('_', ' '))}"
            variables[name] = draws[name].mean(_DRAWS).where(enough).assign_attrs(attrs)
            variables[f"{name}_sd"] = draws[name].std(_DRAWS).where(enough).assign_attrs(attrs | {"long_name": spread})
        shared = xr.cov(draws["contact_x"], draws["contact_y"], _DRAWS, ddof=0).where(enough)
    x_sd, y_sd = variables["contact_x_sd"], variables["contact_y_sd"]
    covariance = np.moveaxis(np.array([[x_sd**2, shared], [shared, y_sd**2]]), -1, 0)
    tangent, normal = spread_across(covariance, variables["slope_angle"].values)
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = shared / (x_sd * y_sd)
    is_tangential = (draws["tangential"].sum(_DRAWS) > 0.5 * number).values
    phase = np.array(PHASE_NAMES)[np.where(enough, np.where(is_tangential, TANGENTIAL, TIP), NONE)]
    unit = draws["contact_x"].attrs.get("units", "1")
    for name, values, units, meaning in (
        ("contact_xy_correlation", correlation.values, "1", "correlation of contact_x and contact_y"),
        ("tangent_sd", tangent, unit, "standard deviation along the contour"),
        ("normal_sd", normal, unit, "standard deviation across the contour"),
        ("contact_phase", phase, "1", "likelier phase"),
        ("contact_probability", draws["contact_x"].notnull().mean(_DRAWS).values, "1", "share of draws in contact"),
    ):
        variables[name] = "sample", values, {"units": units, "long_name": meaning}
    return xr.Dataset(variables, coords={"sample": draws["sample"]})


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
