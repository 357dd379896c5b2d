"""Sensitivity of contact points and of a contour to errors of the sensor, in one result."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import xarray as xr

from tactile_bayes.checks import check_names, check_probability, check_whole_number, refused
from tactile_bayes.contours import Contour, paper_profile
from tactile_bayes.inference.family import Family
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.numerics.random_numbers import Rng, seed_sequence
from tactile_bayes.planning.amplification import amplification
from tactile_bayes.planning.family_parameters import enlarged
from tactile_bayes.planning.information import information
from tactile_bayes.planning.noise_shares import noise_shares
from tactile_bayes.planning.plan import Plan
from tactile_bayes.planning.requirement import required_noise
from tactile_bayes.planning.sensitivity_summary import sensitivity_summary
from tactile_bayes.rig.rig import Rig, rig_of
from tactile_bayes.sweep import Drive

PARTS = ("amplification", "information", "noise_shares", "required_noise")

_WIDTHS = (0.0005, 0.001, 0.0025, 0.005, 0.01)  # default widths of bands [rod lengths]


def sensitivity(
    contour: Contour | None = None,
    rig: Rig | None = None,
    *,
    rng: Rng,
    drive: Drive | Sequence[Drive] | None = None,
    family: Family | None = None,
    band_widths: Sequence[float] | None = None,
    probability: float = 0.95,
    samples: int = 1024,
    parts: Sequence[str] = PARTS,
) -> xr.DataTree:
    """Return the effects of errors of the sensor on contact points and on a contour, and the required noise.

    Parameters
    ----------
    contour : Contour, optional
        Contour of a family with parameters, in the unit of the rod's length; by default profile II of Merker et al.
        2018 (doi 10.1155/2018/1613945) at the distance 0.5 rod lengths.
    rig, drive, family
        As in `Plan`.
    rng : int, numpy.random.SeedSequence or numpy.random.Generator
        Seed of the samples by which Sobol' indices are estimated.
    band_widths : sequence of float, optional
        Mean widths of bands whose required noise is computed [length]; by default 0.0005 to 0.01 rod lengths.
    probability : float
        Probability of the bands, in (0, 1).
    samples : int
        Number of samples for Sobol' indices, a power of two.
    parts : sequence of str
        Names of the groups to compute.

    Returns
    -------
    xr.DataTree
        With the groups

        amplification
            Errors of single contacts by errors of each reading along the sweep, to first order.
        information
            Bounds on every parameter and on the contour, and the contributions of readings.
        noise_shares
            Sobol' indices: shares of the readings' noises, beyond first order.
        required_noise
            Noise that a band of given width requires, as from `tactile_bayes.planning.required_noise`.

        Attribute words: a summary in sentences.

    Raises
    ------
    ParameterError
        If an argument is impossible, a channel has no noise, or the contour is of no family.
    ReachError
        If the rod does not reach the contour.

    Examples
    --------
    >>> found = sensitivity(rng=1, parts=["information", "required_noise"])
    >>> found["information"].bound.sel(parameter="a").item().__round__(4)
    0.0025
    """
    if not set(check_names("parts", parts)) <= set(PARTS) or not parts:
        raise refused("parts", parts, f"give a list of some of {', '.join(PARTS)}")
    seed = seed_sequence(rng)
    check_probability("probability", probability)
    check_whole_number("samples", samples, 1)
    rig = rig_of(rig)
    rod = rig.rod or Rod()
    if contour is None:
        contour = enlarged(paper_profile("II", q=0.5), rod.length)
    plan = Plan(contour, rig, drive, family)
    widths = band_widths if band_widths is not None else [width * rod.length for width in _WIDTHS]
    made_by: dict[str, Callable[[], xr.Dataset]] = {
        "amplification": lambda: amplification(plan),
        "information": lambda: information(plan, probability=probability),
        "noise_shares": lambda: noise_shares(plan, rng=seed, samples=samples),
        "required_noise": lambda: required_noise(plan, widths, probability=probability),
    }
    tree = xr.DataTree.from_dict({part: make() for part, make in made_by.items() if part in parts})
    tree.attrs = {
        "contour": repr(contour),
        "units": plan.record.attrs["units"],
        "rod_length": rod.length,
        "rod_flexural_rigidity": rod.flexural_rigidity,
        "force_noise": plan.cell.force_noise,
        "moment_noise": plan.cell.moment_noise,
        "words": "\n".join(sensitivity_summary(tree, plan.record.attrs["units"] != "dimensionless")),
    }
    return tree
