"""Plans, each in one folder: a design, and a sensitivity analysis."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes import plotting
from tactile_bayes.arrays import Floats
from tactile_bayes.planning.design import design
from tactile_bayes.planning.error_map import CELLS, error_map
from tactile_bayes.planning.plan import Plan
from tactile_bayes.planning.requirement import required_rod
from tactile_bayes.planning.sensitivity import sensitivity
from tactile_bayes.runs.folder import Folder, Run, panels
from tactile_bayes.runs.names import DESIGN, SENSITIVITY, STUDY
from tactile_bayes.tasks import TaskProgress

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_OF_PLAN = tuple(field.name for field in fields(Plan))
_LENGTHS = np.array([0.7, 0.85, 1.0, 1.2, 1.4])
# Lengths and diameters of the rods that are tried, over those of the present rod.
_DIAMETERS = np.array([0.5, 0.7, 0.85, 1.0, 1.2, 1.4, 2.0])


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


class Material(NamedTuple):
    """Material of a rod."""

    youngs_modulus: float  # Young's modulus [Pa]
    elastic_strain: float  # largest elastic bending strain


@dataclass(frozen=True)
class SensitivityRun(Run[xr.DataTree]):
    """Result of `sensitivity`, with rods if a material was given, and a study if one was requested."""

    rods: xr.Dataset | None
    study: xr.Dataset | None


def sensitivity_into(
    out: str | os.PathLike[str],
    *,
    material: Material | None = None,
    study: Mapping[str, Any] | None = None,
    progress: Callable[[int], object] = lambda done: None,
    **options: Any,
) -> SensitivityRun:
    """Analyse the effects of the sensor's errors, and write the results to a folder."""
    found = sensitivity(**options)
    progress(1)
    rods, studied = None, None
    with Folder(out, SENSITIVITY) as folder:
        folder.write_netcdf("sensitivity", "sensitivity.nc", found)
        for part in found.children:
            draw = getattr(plotting, part)
            if part == "noise_shares":
                draw = partial(_draw_both, draw, option="reconstruction", values=("raw", "constrained"))
            folder.draw(part, f"{part}.png", draw, found)
        words = [found.attrs["words"]]
        if material is not None:
            rods = _rods(material, options, lambda rod: progress(1 + rod.done))
            folder.write_netcdf("rods", "rods.nc", rods)
            folder.draw("required_rod", "required_rod.png", plotting.required_rod, rods)
            words.append(rod_message(rods))
        folder.write_lines("words", "words.txt", words)
    files = folder.files
    if study is not None:
        studied = error_map(out=folder.path / "study", **study)
        with Folder(folder.path / "study", STUDY) as inside:
            inside.files["cells"] = inside.path / CELLS.file
            inside.write_netcdf("study", "study.nc", studied)
            draw = partial(_draw_both, plotting.error_map, option="quantity", values=("across", "touched"))
            inside.draw("errors", "study.png", draw, studied)
        files |= inside.files
    return SensitivityRun(found, files, rods, studied)


def rod_message(rods: xr.Dataset) -> str:
    """Return a message on the rod that suits the load cell best, of those that were tried."""
    count, status = rods.status.size, Counter(rods.status.values.ravel().tolist())
    others = ", ".join(f"{number} {what}" for what, number in status.most_common() if what != "ok")
    left_out = f" ({others})" if others else ""
    if not np.isfinite(rods.best_width):
        return f"None of {count} rods of this material suits the load cell{left_out}."
    long, thick, wide = (f"{1e3 * float(rods[f'best_{name}']):.3g} mm" for name in ("length", "diameter", "width"))
    words = (
        f"Of {count} rods of this material{left_out} one {long} long and {thick} thick suits the load cell best: its "
        f"mean band is {wide} wide."
    )
    sides = (("length", "shortest", "longest"), ("diameter", "thinnest", "thickest"))
    end = outermost((rods[name].values, float(rods[f"best_{name}"]), least, most) for name, least, most in sides)
    if end:
        words += f" It is the {end} that was tried: a better one may lie beyond, start from this one."
    return words


def steps_of(material: Material | None) -> int:
    """Return the number of steps of an analysis without a study."""
    return 1 + (0 if material is None else _LENGTHS.size * _DIAMETERS.size)


def _rods(material: Material, options: Mapping[str, Any], progress: Callable[[TaskProgress], object]) -> xr.Dataset:
    plan = Plan(**{name: value for name, value in options.items() if name in _OF_PLAN})
    rod = plan.rod
    own = (64.0 * rod.flexural_rigidity / (np.pi * material.youngs_modulus)) ** 0.25
    return required_rod(
        plan,
        lengths=(rod.length * _LENGTHS).tolist(),
        diameters=(own * _DIAMETERS).tolist(),
        youngs_modulus=material.youngs_modulus,
        elastic_strain=material.elastic_strain,
        progress=progress,
    )


def _draw_both(plot: Callable[..., Axes], found: Any, *, option: str, values: tuple[str, str]) -> Axes:
    """Draw a plot with one value of an option above, and with another below."""
    for ax, value in zip(panels(2, 1, 7.0, 7.4)[:, 0], values, strict=True):
        plot(found, ax=ax, **{option: value})
    return ax
