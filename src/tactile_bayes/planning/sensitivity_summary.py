"""Summary of a sensitivity analysis in sentences."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats

_NAMES = {"holding_moment": "the moment", "force_x": "force_x", "force_y": "force_y", "drive_angle": "the drive angle"}


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
