"""The band that is expected after the rest of a sweep."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from tactile_bayes.checks import check_numbers, check_probability, check_whole_number
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.result import record_of
from tactile_bayes.numerics.random_numbers import Rng, generator
from tactile_bayes.planning.expected_band import band_factor, deviation_of_heights, height_slopes
from tactile_bayes.planning.knowledge import known_from_posterior
from tactile_bayes.planning.record_information import COARSE_STEP, reading_slopes, record_information
from tactile_bayes.record import carried_sweeps
from tactile_bayes.sweep import Direction, Rotation, record_template


def rest_of_sweep(
    posterior: xr.DataTree,
    drive_angles: ArrayLike,
    x: ArrayLike,
    *,
    rng: Rng,
    probability: float = 0.95,
    draws: int = 24,
) -> xr.Dataset:
    """Return the widths of the band now, and those that are expected after the rest of the last sweep.

    Parameters
    ----------
    posterior : xr.DataTree
        From `Stream.posterior` or `infer_contour`, of a record whose last sweep may go on.
    drive_angles : array_like, shape (n,)
        Drive angles of the samples to come, in the direction of that sweep [rad].
    x : array_like, shape (k,)
        Positions of the band [length].
    rng : int, numpy.random.SeedSequence or numpy.random.Generator
        Seed of the draws.
    probability : float
        Probability of the pointwise band, in (0, 1).
    draws : int
        Number of contours that are drawn, at least 2; at most all draws of the posterior are taken.

    Returns
    -------
    xr.Dataset
        Over "x": `present_width`, and `width` with its standard error over draws, `width_error` [length].

    Raises
    ------
    ParameterError
        If an argument is impossible, the contour is shape-free, or the drive carries the base in the last sweep.
    InferenceError
        If the tree is no posterior of a contour.
    ReachError
        If the rod does not reach a contour of the posterior.

    Notes
    -----
    Both are to first order, as in `design`: the precision of each draw is that of the posterior, plus Fisher's
    information of the samples to come. What their snap-off excludes is not counted.

    Examples
    --------
    >>> from tactile_bayes import LoadCell, Rig, Stream, scan
    >>> from tactile_bayes.contours import paper_profile
    >>> cell = LoadCell(force_noise=0.05, moment_noise=0.02)
    >>> measured = cell.measure(scan(paper_profile("II", q=0.5), drive_step=0.05).record, rng=1)
    >>> stream = Stream(rig=Rig(load_cell=cell, unknown="nothing"), rng=1, particles=200)
    >>> _ = stream.update(measured.isel(sample=slice(0, 30)))
    >>> more = rest_of_sweep(stream.posterior(), measured.drive_angle[30:55], [0.0, 0.1], rng=1)
    >>> bool((more.width < more.present_width).all())
    True
    """
    check_whole_number("draws", draws, 2)
    check_probability("probability", probability)
    at = check_numbers("x", x, "give a list of finite numbers", shape=(None,))
    angles = check_numbers("drive_angles", drive_angles, "give drive angles in radians", shape=(None,))
    known = known_from_posterior(posterior, draws=draws, rng=generator(rng))
    record = record_of(posterior)
    last = record.isel(sample=-1)
    direction: Direction = "forward" if last.direction == "forward" else "backward"
    end = float(last.drive_angle)
    if int(last.sweep) in carried_sweeps(record):
        raise ParameterError("the drive carries the base in the last sweep: give the whole drive to design instead")
    ahead = angles > end if direction == "forward" else angles < end
    if not ahead.all():
        raise ParameterError(
            f"drive_angles have {float(angles[~ahead][0]):g} rad, which is behind the last sample of the {direction} "
            f"sweep, at {end:g} rad: give those to come"
        )
    base = (float(last.base_x), float(last.base_y))
    cell = known.experiment.noise.cell
    model = known.model(record_template([Rotation(base, direction)], angles, known.rod, cell))
    own, factor = known.of(model), band_factor(probability)
    count = len(own.points)
    now, then = np.empty((count, at.size)), np.empty((count, at.size))
    for k, point in enumerate(own.points):
        slopes = height_slopes(model, point, at)
        gained = record_information(model, point, slopes=reading_slopes(model, point, COARSE_STEP)).matrix
        now[k] = factor * deviation_of_heights(slopes, own.precision)
        then[k] = factor * deviation_of_heights(slopes, own.precision + gained)
    unit = {"units": "1" if known.rod.is_dimensionless else "m"}
    return xr.Dataset(
        {
            "present_width": ("x", now.mean(axis=0), unit),
            "width": ("x", then.mean(axis=0), unit),
            "width_error": ("x", then.std(axis=0, ddof=1) / np.sqrt(count), unit),
        },
        coords={"x": ("x", at, unit)},
        attrs={"probability": probability},
    )
