"""A design, in one folder."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.files import write_atomically
from tactile_bayes.netcdf import write_netcdf
from tactile_bayes.planning.design import design
from tactile_bayes.runs.outermost import outermost
from tactile_bayes.runs.picture import write_picture

__all__ = ["DesignRun", "design_in_words", "design_into"]


@dataclass(frozen=True)
class DesignRun:
    """What `design_into` made.

    Attributes
    ----------
    design : xr.Dataset
        From `tactile_bayes.design`.
    files : mapping of str to Path
        By what they hold.
    """

    design: xr.Dataset
    files: Mapping[str, Path]


def design_into(out: str | os.PathLike[str], *args: Any, nested: bool = False, **options: Any) -> DesignRun:
    """Choose the next record, and write what comes out to a folder.

    Parameters
    ----------
    out : path-like
        Folder for design.nc, candidates.csv, words.txt and design.png; made if it is not there. Files of these names in
        it are replaced.
    args, options
        As `design` takes them.
    nested : bool
        Likewise; what was found of each candidate is then kept in a folder "nested" within, and a run that was stopped
        goes on.

    Returns
    -------
    DesignRun

    Raises
    ------
    ParameterError, InferenceError, ReachError, StudyError, TaskError
        As `design`.
    """
    folder = Path(out)
    found = design(*args, nested=nested, out=folder / "nested" if nested else None, **options)
    folder.mkdir(parents=True, exist_ok=True)
    files = {
        "design": folder / "design.nc",
        "candidates": folder / "candidates.csv",
        "words": folder / "words.txt",
        "figure": folder / "design.png",
    }
    write_netcdf(found, files["design"])
    columns = [name for name, values in found.data_vars.items() if values.dims == ("candidate",)]
    with write_atomically(files["candidates"]) as temporary:
        rows = np.stack([found[name].values for name in columns], axis=1)
        lines = [",".join(map(str, columns)), *(",".join(f"{value:.9g}" for value in row) for row in rows)]
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
    with write_atomically(files["words"]) as temporary:
        temporary.write_text("\n".join(design_in_words(found)) + "\n", encoding="utf-8")
    _draw(found, files["figure"])
    return DesignRun(found, files)


def design_in_words(found: xr.Dataset) -> tuple[str, ...]:
    """Which candidate is the best, and how much better."""
    best = found.isel(candidate=int(found.best))
    si = found.base_x.attrs.get("units") == "m"

    def length(value: float) -> str:
        return f"{1e3 * value:.3g} mm" if si else f"{value:.3g} L"

    place = f"({length(float(best.base_x))}, {length(float(best.base_y))})"
    probability = f"{found.attrs['probability']:.0%}"
    sentences = [
        f"Put the pivot at {place} and step the drive by {np.degrees(float(best.drive_step)):.3g}°: the {probability} "
        f"band is then to be expected {length(float(best.width))} wide; now it is "
        f"{length(float(found.present_width))}."
    ]
    if np.isfinite(float(best.gap)):
        sentences[0] += f" Of the contour between the outermost contacts {length(float(best.gap))} stay untouched."
    sides = (("base_x", "leftmost", "rightmost"), ("base_y", "lowest", "highest"))
    end = outermost((found[name].values, float(best[name]), least, most) for name, least, most in sides)
    if end:
        sentences.append(f"It is the {end} of the candidates: beyond there may be a better one, try with more.")
    worst = found.isel(candidate=int(np.nanargmax(found.width.values)))
    if found.sizes["candidate"] > 1:
        ratio = float(worst.width / best.width)
        sentences.append(
            f"From the worst of {found.sizes['candidate']} candidates, ({length(float(worst.base_x))}, "
            f"{length(float(worst.base_y))}), the band would be {ratio:.2g} times as wide."
        )
    if float(best.reached) < 1.0:
        sentences.append(f"From there the rod reaches {float(best.reached):.0%} of the objects that may be there.")
    if np.isfinite(float(best.nested_width)):
        sentences.append(
            f"Sampled posteriors give {length(float(best.nested_width))} ± {length(float(best.nested_width_error))} "
            f"there, Laplace's approximation {length(float(best.width))}."
        )
    return tuple(sentences)


def _draw(found: xr.Dataset, path: Path) -> None:
    from matplotlib import pyplot as plt

    from tactile_bayes import plotting

    with plt.ioff():
        plt.sca(plotting.design(found))
        write_picture(plt.gcf(), path)
        plt.close()
