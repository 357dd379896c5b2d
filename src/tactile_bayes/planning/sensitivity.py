"""Sensitivity of contact points and of a contour to errors of the sensor, in one result."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_names, check_probability, check_whole_number, refused
from tactile_bayes.contours import Contour, paper_profile
from tactile_bayes.inference.family import Family
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.numerics.random_numbers import Rng, seed_sequence
from tactile_bayes.planning.amplification import amplification
from tactile_bayes.planning.information import information
from tactile_bayes.planning.noise_shares import noise_shares
from tactile_bayes.planning.plan import Plan, enlarged
from tactile_bayes.planning.requirement import required_noise
from tactile_bayes.rig.rig import Rig, rig_of
from tactile_bayes.sweep import Drive

PARTS = ("amplification", "information", "noise_shares", "required_noise")

_WIDTHS = (0.0005, 0.001, 0.0025, 0.005, 0.01)  # default widths of bands [rod lengths]
_NAMES = {"holding_moment": "the moment", "force_x": "force_x", "force_y": "force_y", "drive_angle": "the drive angle"}


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


def sensitivity_summary(tree: xr.DataTree, si: bool) -> Iterator[str]:
    """Yield sentences on the main results of a sensitivity analysis."""
    if "amplification" in tree:
        grown = tree["amplification"].to_dataset()
        for method in grown.reconstruction.values:
            of = grown.sel(reconstruction=method)
            ok, weight = of.holds.values, _spacing(of)
            if not ok.any():
                yield f"First order holds for no {method} contact point at this noise."
                continue
            medians = (
                np.quantile(of[name].values[ok], 0.5, weights=weight[ok], method="inverted_cdf")
                for name in ("sd_along", "sd_across")
            )
            along, across = (_length(float(median), si) for median in medians)
            share = weight[ok].sum() / weight.sum()
            yield (
                f"A {method} contact point is off by {along} along the contour and {across} across it (medians of "
                f"standard deviations), where first order holds: over {share:.0%} of the sweep."
            )
        raw = grown.sel(reconstruction="raw")
        powers = raw.growth_across.sel(event="first contact").values
        known = powers[np.isfinite(powers)]
        if known.size and known.min() < -0.3:
            yield (
                "Toward first contact the errors of raw contact points grow without bound, like the distance in drive "
                f"angle to the power of {known.min():.1f}: loads vanish there."
            )
    if "noise_shares" in tree:
        shares = tree["noise_shares"].to_dataset().sel(reconstruction="raw", error="across")
        mean = shares.share.mean("sample", skipna=True)
        if np.isfinite(mean.values).all():
            largest = str(mean.source.values[int(np.argmax(mean.values))])
            yield (
                f"Across the contour the error of a raw contact point comes mostly from {_NAMES[largest]}: "
                f"{float(mean.max()):.0%} of its variance on the mean over the sweep."
            )
    if "information" in tree:
        found = tree["information"].to_dataset()
        widths = {"where the contour is touched": float(found.touched_width), "in the gap": float(found.gap_width)}
        parts = [f"{_length(width, si)} {where}" for where, width in widths.items() if np.isfinite(width)]
        yield f"The expected width of the {found.attrs['probability']:.0%} band is {' and '.join(parts)}."
        lost = found.bound_without_channel.values / found.bound_with_priors.values
        own = [i for i, name in enumerate(found.parameter.values) if str(name) != "noise_scale"]
        worst = np.exp(np.log(lost[:, own]).mean(axis=1))
        channel = str(found.channel.values[int(np.argmax(worst))])
        yield (
            f"Most information is lost without {_NAMES[channel]}: bounds on the parameters would be {worst.max():.1f} "
            "times as large, on the geometric mean."
        )
    if "required_noise" in tree:
        needed = tree["required_noise"].to_dataset()
        columns = (needed[name].values.tolist() for name in ("band_width", "force_noise", "moment_noise"))
        for width, force, moment in zip(*columns, strict=True):
            how = f"needs {_noise(force, moment, si)}"
            if not np.isfinite(force):
                how = "follows from the priors without any record"
            yield f"A mean band of {_length(width, si)} {how}."


def _spacing(grown: xr.Dataset) -> Floats:
    """Return the spacing of states along the drive: they are dense near first contact and snap-off."""
    spacing = np.empty(grown.sizes["sample"])
    for sweep in np.unique(grown.sweep.values):
        here = np.flatnonzero(grown.sweep.values == sweep)
        travel = grown.after_first_contact.values[here]
        spacing[here] = np.abs(np.gradient(travel)) if here.size > 1 else 1.0
    return spacing


def _length(value: float, si: bool) -> str:
    return f"{1e3 * value:.3g} mm" if si else f"{value:.3g} L"


def _noise(force: float, moment: float, si: bool) -> str:
    if not si:
        return f"{force:.2g} EI/L² of noise in the forces and {moment:.2g} EI/L in the moment"
    return f"{1e3 * force:.2g} mN of noise in the forces and {1e3 * moment:.2g} mN m in the moment"
