"""A sensitivity analysis, in one folder."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes import plotting
from tactile_bayes.planning.error_map import CELLS, error_map
from tactile_bayes.planning.plan import Plan
from tactile_bayes.planning.requirement import required_rod
from tactile_bayes.planning.sensitivity import sensitivity
from tactile_bayes.runs.design import outermost
from tactile_bayes.runs.folder import Folder, Run, panels
from tactile_bayes.runs.names import SENSITIVITY, STUDY
from tactile_bayes.tasks import TaskProgress

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_OF_PLAN = tuple(field.name for field in fields(Plan))
_LENGTHS = np.array([0.7, 0.85, 1.0, 1.2, 1.4])
# Lengths and diameters of the rods that are tried, over those of the present rod.
_DIAMETERS = np.array([0.5, 0.7, 0.85, 1.0, 1.2, 1.4, 2.0])


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
            draw = _draw_noise_shares if part == "noise_shares" else getattr(plotting, part)
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
            inside.draw("errors", "study.png", _draw_study, studied)
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


def _draw_noise_shares(found: xr.DataTree) -> Axes:
    """Draw the noise shares of both methods of Step 2."""
    above, below = panels(2, 1, 7.0, 7.4)[:, 0]
    plotting.noise_shares(found, reconstruction="raw", ax=above)
    return plotting.noise_shares(found, reconstruction="constrained", ax=below)


def _draw_study(studied: xr.Dataset) -> Axes:
    """Draw the errors of contacts and the widths of bands."""
    above, below = panels(2, 1, 7.0, 7.4)[:, 0]
    plotting.error_map(studied, quantity="across", ax=above)
    return plotting.error_map(studied, quantity="touched", ax=below)
