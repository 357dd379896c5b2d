"""A design, in one folder."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes import plotting
from tactile_bayes.arrays import Floats
from tactile_bayes.planning.design import design
from tactile_bayes.runs.folder import Folder, Run
from tactile_bayes.runs.names import DESIGN


def design_into(out: str | os.PathLike[str], *args: Any, nested: bool = False, **options: Any) -> Run[xr.Dataset]:
    """Choose the next record, and write the result to a folder."""
    found = design(*args, nested=nested, out=Path(out) / "nested" if nested else None, **options)
    columns = [str(name) for name, values in found.data_vars.items() if values.dims == ("candidate",)]
    columns = [name for name in columns if name not in ("drive", "is_pivot")]
    if not found.is_pivot.values.all():
        columns.append("drive")
    candidates = found[columns].to_dataframe()[columns]
    with Folder(out, DESIGN) as folder:
        folder.write_netcdf("design", "design.nc", found)
        with folder.file("candidates", "candidates.csv") as temporary:
            candidates.to_csv(temporary, index=False, float_format="%.9g", na_rep="nan")
        folder.write_lines("words", "words.txt", design_messages(found))
        folder.draw("figure", "design.png", plotting.design, found)
    return Run(found, folder.files)


def design_messages(found: xr.Dataset) -> tuple[str, ...]:
    """Return sentences on the best candidate and its advantage."""
    best = found.isel(candidate=int(found.best))
    si = found.base_x.attrs.get("units") == "m"

    def length(value: float) -> str:
        return f"{1e3 * value:.3g} mm" if si else f"{value:.3g} L"

    def place(candidate: xr.Dataset) -> str:
        return f"({length(float(candidate.base_x))}, {length(float(candidate.base_y))})"

    def words(candidate: xr.Dataset) -> str:
        return f"the pivot {place(candidate)}" if candidate.is_pivot else f"{candidate.drive.item()}{' [m]' * si}"

    if best.is_pivot:
        what = f"Put the pivot at {place(best)} and step the drive by {np.degrees(float(best.drive_step)):.3g}°"
    else:
        what = f"The best drive: {words(best)}, with {int(best.samples):,} readings"
    sentences = [
        f"{what}: the {found.attrs['probability']:.0%} band is then {length(float(best.width))} wide on the mean; now "
        f"it is {length(float(found.present_width))}."
    ]
    if np.isfinite(float(best.gap)):
        sentences[0] += f" Of the contour between the outermost contacts {length(float(best.gap))} stay untouched."
    sides = (("base_x", "leftmost", "rightmost"), ("base_y", "lowest", "highest"))
    end = outermost((found[name].values, float(best[name]), least, most) for name, least, most in sides)
    if end and found.is_pivot.values.all():
        sentences.append(f"It is the {end} of the candidates: a better one may lie beyond, try more.")
    worst = found.isel(candidate=int(np.nanargmax(found.width.values)))
    if found.sizes["candidate"] > 1:
        ratio = float(worst.width / best.width)
        sentences.append(
            f"With the worst of {found.sizes['candidate']} candidates, {words(worst)}, the band would be {ratio:.2g} "
            "times as wide."
        )
    alike = found.isel(candidate=np.flatnonzero(found.drive_step == best.drive_step))
    if np.ptp(alike.samples.values) > 0:
        most = alike.isel(candidate=int(np.nanargmax(alike.information / alike.samples)))
        sentences.append(
            f"The most information per reading: {words(most)}, {float(most.information):.3g} nats in "
            f"{int(most.samples):,} readings."
        )
    if float(best.reached) < 1.0:
        sentences.append(f"With it the rod reaches {float(best.reached):.0%} of the possible objects.")
    if np.isfinite(float(best.nested_width)):
        sentences.append(
            f"Sampled posteriors give {length(float(best.nested_width))} ± {length(float(best.nested_width_error))}, "
            f"Laplace's approximation {length(float(best.width))}."
        )
    return tuple(sentences)


def outermost(choices: Iterable[tuple[Floats, float, str, str]]) -> str:
    """Return the extremes at which the best choice lies, as text; "" if it lies inside all ranges."""
    words: list[str] = []
    for tried, best, least, most in choices:
        if np.ptp(tried) > 0.0:
            words += [least] * bool(best == tried.min()) + [most] * bool(best == tried.max())
    return " and ".join(words)
