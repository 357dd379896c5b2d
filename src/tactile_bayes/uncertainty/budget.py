"""What sets the width of a contour's band: each unknown of the rig, all of them, and the contour's place."""

from __future__ import annotations

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.contours.families import family_named
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.result import contour_draws
from tactile_bayes.numerics.selection import evenly_spread
from tactile_bayes.uncertainty.band import contours_drawn, length_unit, quantile_band
from tactile_bayes.uncertainty.offsets import aligned, feet_of, most_central, normal_offsets
from tactile_bayes.uncertainty.rod_reach import reach

_DRAWS = 2000
_EVERY = 5  # of the grid points of `reach`, the places at which widths are measured


def uncertainty_budget(posterior: xr.DataTree, probability: float = 0.95) -> xr.Dataset:
    """Return how much of the band's width each unknown accounts for, and the width if it were known.

    By linear regression of the draws' contours on the draws of the unknowns, without further sampling.

    Parameters
    ----------
    posterior : xr.DataTree
        From `infer_contour`.
    probability : float
        Probability of the band, in (0, 1).

    Returns
    -------
    xr.Dataset
        Half widths [length] are medians of those of `normal_band`, over what is touched of the posterior's contours.

        Over "unknown", the unknowns of rig and load cell: share, the share of the variance that the unknown explains
        by itself; half_width_if_known. Correlated unknowns share their shares, so that the sum may exceed one.

        Scalars: half_width; half_width_if_all_known, which noise and the contour's own parameters leave;
        half_width_of_shape, of the contours shifted onto one another (`align="translation"`).

    Raises
    ------
    InferenceError, ParameterError
        If the tree is no result of `infer_contour`, the rod touches none of its contours, or no normal meets them all;
        if the probability is not in (0, 1).

    Examples
    --------
    >>> known, shift = np.random.default_rng(1).normal(size=(2, 4, 500))
    >>> draws = {"a": 0.5 + 0.0 * shift, "q": 0.3 + 3e-3 * shift + 1e-3 * known, "x_c": 0.0 * shift, "lever_y": shift}
    >>> events = {"first_contact_x": 0.4 + 0.0 * shift, "snap_off_contact_x": -0.4 + 0.0 * shift}
    >>> over = ("chain", "draw", "segment")
    >>> tree = xr.DataTree.from_dict({
    ...     "posterior": xr.Dataset({k: (over[:2], v) for k, v in draws.items()}),
    ...     "events": xr.Dataset({k: (over, v[:, :, None]) for k, v in events.items()}),
    ... })
    >>> tree.attrs = {"family": "parabola", "units": "dimensionless"}
    >>> found = uncertainty_budget(tree)
    >>> round(found.share.sel(unknown="lever_y").item(), 2), round(float(found.half_width_of_shape), 9)
    (0.9, 0.0)
    """
    draws = contour_draws(posterior)
    family = family_named(posterior.attrs["family"])
    over = ("chain", "draw")
    names = [str(name) for name, v in draws.items() if set(v.dims) == set(over) and name not in family.parameters]
    every = evenly_spread(draws.sizes["chain"] * draws.sizes["draw"], _DRAWS)
    drawn = {name: draws[name].transpose(*over).values.ravel()[every] for name in names}
    drawn = {name: (each - each.mean()) / each.std() for name, each in drawn.items() if np.ptp(each) > 0.0}
    names, values = list(drawn), np.array(list(drawn.values())).reshape(len(drawn), len(every))

    x, contours = reach(posterior)[::_EVERY], contours_drawn(posterior, _DRAWS)
    feet = feet_of(most_central(contours, x), x)
    offsets = normal_offsets(contours, feet)
    met = np.isfinite(offsets).all(axis=0)
    if not met.any():
        raise InferenceError("no normal meets all contours of the posterior: there is no band")
    offsets = offsets[:, met]
    width = _half_width(offsets, probability)
    shape = _half_width(normal_offsets(contours, feet, aligned(contours, feet, "translation")), probability)
    offsets = offsets - offsets.mean(axis=0)
    variance = np.maximum((offsets**2).mean(axis=0), np.finfo(float).tiny)
    explained = (values @ offsets / max(len(offsets), 1)) ** 2
    together = np.linalg.lstsq(values.T, offsets, rcond=None)[0] if names else np.zeros((0, offsets.shape[1]))
    freedom = max(len(offsets) - len(names) - 1, 1)
    left = ((offsets - values.T @ together) ** 2).sum(axis=0) / freedom

    def typical(remaining: object) -> object:
        return np.nanmedian(width * np.sqrt(np.clip(np.asarray(remaining) / variance, 0.0, 1.0)), axis=-1)

    unit = length_unit(posterior)
    return xr.Dataset(
        {
            "share": ("unknown", explained.sum(axis=1) / variance.sum(), {"units": "1"}),
            "half_width_if_known": ("unknown", typical(variance - explained), unit),
            "half_width": ((), typical(variance), unit),
            "half_width_if_all_known": ((), typical(left), unit),
            "half_width_of_shape": ((), np.nanmedian(shape), unit),
        },
        coords={"unknown": names},
        attrs={"probability": probability},
    )


def _half_width(offsets: Floats, probability: float) -> Floats:
    """Return half the width of the band of offsets, (draws, places), at each place."""
    lower, _, upper = quantile_band(offsets, probability)
    return np.asarray(0.5 * (upper - lower))
