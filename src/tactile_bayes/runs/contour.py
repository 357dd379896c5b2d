"""The analysis of one record, in one folder."""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes import plotting
from tactile_bayes.arrays import Floats
from tactile_bayes.assessment.causes import causes
from tactile_bayes.checks import check_probability
from tactile_bayes.contours import Contour
from tactile_bayes.contours.families import family_named
from tactile_bayes.diagnostics.result_check import Check, check
from tactile_bayes.diagnostics.units_and_signs import unit_and_sign_findings
from tactile_bayes.errors import InferenceError, TactileBayesError
from tactile_bayes.inference.contour import contours_of, infer_contour
from tactile_bayes.inference.experiment import contact_points
from tactile_bayes.inference.family import family_of
from tactile_bayes.inference.result import best_draw, known_of, posterior_draws, record_of, write_result
from tactile_bayes.numerics.random_numbers import Rng
from tactile_bayes.plotting.maps import set_below
from tactile_bayes.record import carried_sweeps, rod_of, validate, with_rod
from tactile_bayes.rig.parameters import COMPLIANCES
from tactile_bayes.rig.rig import Rig, rig_of
from tactile_bayes.rig.stated import rod_with
from tactile_bayes.runs.folder import Folder, panels
from tactile_bayes.runs.names import INFERENCE, OF_POSTERIOR, PICTURES, WATCH_PAGE
from tactile_bayes.sweep import Scan, recorded_drives, scan
from tactile_bayes.tasks import refuse_replacing, replace_together
from tactile_bayes.tasks.documents import read_json
from tactile_bayes.uncertainty.band import contour_band
from tactile_bayes.uncertainty.predictive_interval import predictive_interval
from tactile_bayes.uncertainty.rod_reach import reach
from tactile_bayes.uncertainty.summary import gap_if_any, summary

_POSTERIOR = "posterior.nc"
_LONG = 20.0  # time of search and sampling [s] from which their draws are kept before anything else is computed
_MISFIT = {"not described", "misfit as noise"}  # kinds of findings of which the causes are sought
_MOST_PARAMETERS = 5  # largest number of parameters in a figure, unless a contour has more

Follow = Callable[[str], object]


@dataclass(frozen=True)
class ContourRun:
    """Result of `analyse`."""

    posterior: xr.DataTree
    # Most probable contact points (raw Step 2 for Student's t with 2 degrees of freedom and fewer); None if a load
    # channel is missing.
    contacts: xr.Dataset | None
    band: xr.Dataset | None
    summary: xr.Dataset
    checked: Check | None
    messages: tuple[str, ...]  # of the check; last, what is left out, and why
    files: Mapping[str, Path]  # by content
    left_out: Mapping[str, BaseException]  # by the part that failed after sampling, which is None, or has no file

    @property
    def is_interrupted(self) -> bool:
        """True if an interrupt ended sampling, or a part of what follows."""
        parts = (isinstance(error, KeyboardInterrupt) for error in self.left_out.values())
        return "interrupted" in self.posterior.attrs["message"] or any(parts)


class RunFolder(Folder):
    """A folder of results from which parts that fail are left out."""

    def __init__(self, out: str | os.PathLike[str]) -> None:
        super().__init__(out, [name for name in INFERENCE if name != _POSTERIOR])
        self.left_out: dict[str, BaseException] = {}

    @contextmanager
    def attempt(self, what: str, name: str) -> Iterator[None]:
        """Note an error or an interrupt of the block under this name, and drop its file."""
        try:
            yield
        except (Exception, KeyboardInterrupt) as error:
            self.left_out[what] = error
            (self._new / name).unlink(missing_ok=True)

    def write_posterior(self, posterior: xr.DataTree, names: Sequence[str] = (*INFERENCE, *OF_POSTERIOR)) -> None:
        """Write the posterior at once in place of files of these names, by default of all that belong to another."""
        with replace_together(self.path, names) as temporary:
            write_result(posterior, temporary / _POSTERIOR)
        self.files["posterior"] = self.path / _POSTERIOR

    @property
    def messages(self) -> tuple[str, ...]:
        """A message for each part that is left out."""
        return tuple(f"Left out: {what}. {_said(error)}" for what, error in self.left_out.items())


def _said(error: BaseException) -> str:
    if isinstance(error, KeyboardInterrupt):
        return "It was interrupted."
    if isinstance(error, TactileBayesError):
        return str(error)
    if isinstance(error, OSError) and error.filename:
        return f"{error.filename}: {error.strerror}"
    return f"Unexpected error, {type(error).__name__}: {str(error) or 'no message'}"


def analyse(
    measured: xr.Dataset,
    out: str | os.PathLike[str],
    *,
    rig: Rig | None = None,
    probability: float = 0.95,
    rng: Rng,
    truth: Contour | None = None,
    record_file: str | os.PathLike[str] | None = None,
    command: Sequence[str] = (),
    figures: bool = True,
    follow: Follow = lambda what: None,
    **options: Any,
) -> ContourRun:
    """Write contact points, contour posterior, band and, if asked for, figures of a record to a folder.

    The posterior is written once it is sampled, in place of a former run (of a long run before predictions are made,
    which may be killed), and all other files at the end.
    A part that fails is left out and named. `follow` is called with the name of each part after sampling, as it begins.
    """
    check_probability("probability", probability)
    options["family"], rig = family_of(options.get("family", "parabola")), rig_of(rig)
    measured = with_rod(validate(measured), rig.rod)
    origin = origin_of(measured, probability, command)
    written = (*INFERENCE, *OF_POSTERIOR, WATCH_PAGE)
    if record_file is not None:
        refuse_replacing((Path(out) / name for name in written), [Path(record_file)])
        origin |= file_of(record_file, hashlib.sha256(Path(record_file).read_bytes()).hexdigest())
    folder, drawn, began = RunFolder(out), list[xr.DataTree](), time.monotonic()

    def write() -> None:
        drawn[-1].attrs |= origin
        folder.write_posterior(drawn[-1], written)

    def keep(posterior: xr.DataTree) -> None:
        drawn.append(posterior)
        if time.monotonic() - began > _LONG:
            write()

    try:
        drawn.append(infer_contour(measured, rig=rig, rng=rng, keep=keep, **options))
    except Exception as error:
        if not drawn and isinstance(error, InferenceError):
            raise type(error)(" ".join((str(error), *unit_and_sign_findings(measured, rig.load_cell)))) from error
        if not drawn:
            raise
        folder.left_out["predictions"] = error
    finally:
        if drawn:
            write()
    return complete(folder, measured, rig, drawn[-1], probability, truth, figures, follow)


def complete(
    folder: RunFolder,
    measured: xr.Dataset,
    rig: Rig,
    result: xr.DataTree,
    probability: float,
    truth: Contour | None = None,
    figures: bool = True,
    follow: Follow = lambda what: None,
) -> ContourRun:
    """Write what follows from the posterior in a folder, of a long record by the samples that the likelihood took."""
    if "blocks" in result.attrs:
        measured, rig = record_of(result), replace(rig, load_cell=None)
    with folder:
        contacts, band, edges, checked = None, None, None, None
        follow("contact points, band and checks")
        with folder.attempt("contacts", "contacts.csv"):
            contacts = contact_points(measured, result, rig.load_cell)
            if contacts is not None:
                folder.write_table("contacts", "contacts.csv", contacts)
        with folder.attempt("band", "band.csv"):
            band = contour_band(result, reach(result), probability)
            folder.write_table("band", "band.csv", band)
        with folder.attempt("gap", "gap.png"):
            edges = gap_if_any(result, probability)
        with folder.attempt("check", "summary.txt"):
            checked = check(result, contacts)
        if checked is not None and any(finding.kind in _MISFIT for finding in checked.messages):
            follow("what may be wrong, a second or two each")
            with folder.attempt("causes", "causes"):
                result["causes"] = xr.DataTree(causes(result))
                folder.write_posterior(result, [_POSTERIOR])
                checked = check(result, contacts)
        numbers = summary(result, probability, edges)
        found = () if checked is None else checked.messages

        folder.write_summary((*found, *folder.messages), numbers, result.attrs["message"])
        if figures:
            follow("figures")
            _draw(_Figures(measured, result, contacts, band, edges, numbers, truth), folder)
            folder.write_summary((*found, *folder.messages), numbers, result.attrs["message"])  # with what failed now
        said = (*found, *folder.messages)
        return ContourRun(result, contacts, band, numbers, checked, said, folder.files, folder.left_out)


def origin_of(measured: xr.Dataset, probability: float, command: Sequence[str]) -> dict[str, Any]:
    """Return attributes that state the record of a run, and the command that started it."""
    said = {
        str(name): value.item() if isinstance(value, np.generic) else value
        for name, value in measured.attrs.items()
        if not str(name).startswith(("rod_", "load_cell_")) and name != "units"
    }
    origin: dict[str, Any] = {"probability": probability, "record_attributes": json.dumps(said, default=str)}
    if command:
        origin["command"] = json.dumps(list(command))
    return origin


def file_of(path: str | os.PathLike[str], sha256: str) -> dict[str, Any]:
    """Return attributes that state the file of a record."""
    return {"record_file": Path(path).name, "record_file_sha256": sha256}


def _draw(figures: _Figures, folder: RunFolder) -> None:
    for name in PICTURES:
        if name != "gap" or figures.edges is not None:
            with folder.attempt(f"figure {name}", f"{name}.png"):
                folder.draw(name, f"{name}.png", getattr(figures, name))


@dataclass(frozen=True)
class _Figures:
    """Figures of a run; each method returns the Axes of one."""

    measured: xr.Dataset
    result: xr.DataTree
    contacts: xr.Dataset | None
    band: xr.Dataset | None
    edges: xr.Dataset | None
    numbers: xr.Dataset
    truth: Contour | None

    @cached_property
    def draws(self) -> xr.Dataset:
        return posterior_draws(self.result)

    @cached_property
    def names(self) -> list[str]:
        """Parameters that have a meaning by themselves."""
        mute = family_named(self.result.attrs["family"]).roughness
        return [str(name) for name in self.draws.data_vars if name not in mute]

    @cached_property
    def of_contour(self) -> list[str]:
        """Those of them that are the contour's."""
        return [name for name in family_named(self.result.attrs["family"]).parameters if name in self.names]

    @cached_property
    def base(self) -> tuple[float, float]:
        return float(self.measured.base_x[0]), float(self.measured.base_y[0])

    @cached_property
    def fitted(self) -> Scan:
        """A scan of the most probable contour."""
        draw, attrs = best_draw(self.result), self.result.attrs
        inferred = [name for name in read_json(attrs["nuisances"], "nuisances") if name in draw]
        found = {**known_of(attrs), **{name: float(draw[name]) for name in inferred}}
        if self.measured.attrs["units"] == "dimensionless":
            found.pop("length", None)  # a scan would be in lengths of that rod
        contour = contours_of(draw, attrs["family"]).take(np.array(0))
        acting = {name: found.get(name, 0.0) for name in ("friction", *COMPLIANCES)}
        rig = Rig(rod_with(rod_of(self.measured), found), unknown=acting)
        if carried_sweeps(self.measured):
            return scan(contour, rig, drive=recorded_drives(self.measured))
        swept = self.result["events"].segment.values if "events" in self.result.children else []
        directions = [direction for direction in ("forward", "backward") if direction in swept]
        direction: Any = "both" if len(directions) == 2 else directions[0]
        return scan(contour, rig, direction=direction, base=self.base)

    def predictive(self) -> Any:
        axes = _plain_panels(6, 1, 7.0, 8.4, 0.55, above=0.65, left=1.1, hspace=0.14, height_ratios=3 * (2.0, 1.0))
        for ax in axes[:-1, 0]:
            ax.sharex(axes[-1, 0])
            ax.tick_params(labelbottom=False)
        probability = float(self.result.attrs["probability"])
        interval = predictive_interval(self.result, probability)
        label = f"{100 * probability:.6g} % predictive"
        plotting.predictive(self.measured, interval, axes=axes[::2, 0], residuals=axes[1::2, 0], label=label)
        axes[0, 0].figure.align_ylabels(axes[:, 0])
        return axes

    def rods(self) -> Any:
        count, width = len(self.fitted.sweeps), 8.5 if carried_sweeps(self.measured) else 7.0
        axes = panels(count, 1, width, 4.0 * count)  # maps of a base that moves are wide
        for number, ax in enumerate(axes[:, 0]):
            plotting.rods(self.fitted, sweep=number, ax=ax)
        return axes

    def contour(self) -> Any:
        if self.band is None:
            raise InferenceError("there is no band to be drawn")
        above, below = panels(2, 1, 7.0, 6.0, sharex=True, height_ratios=(2.6, 1.0))[:, 0]
        known: dict[str, Any] = {"truth": self.truth, "gap": self.edges}
        base = None if carried_sweeps(self.measured) else self.base
        plotting.contour(self.band.x.values, contacts=self.contacts, band=self.band, base=base, ax=above, **known)
        shape = contour_band(self.result, self.band.x.values, self.band.attrs["probability"], align="translation")
        plotting.band_detail(self.band, shape=shape, ax=below, **known)
        above.set_xlabel("")
        set_below(above, below)
        return above

    def gap(self) -> Any:
        assert self.edges is not None
        return plotting.gap(self.edges, truth=self.truth, ax=panels(1, 1, 7.0, 3.6)[0, 0])

    def trace(self) -> Any:
        """Return the traces of the contour's parameters, and of those with the fewest effective draws."""
        draws = self.numbers["ess_bulk"].sel(quantity=self.names).values
        names = self._with_the_contour(draws)
        axes = _plain_panels(len(names), 2, 7.5, 1.25 * len(names), 0.85, hspace=0.75, width_ratios=(2.0, 1.0))
        plotting.trace(self.result, names=names, axes=axes)
        axes[0, 0].figure.align_ylabels(list(axes[:, 0]))
        return axes

    def pairs(self) -> Any:
        """Return the marginals of the contour's parameters, and of those most correlated with them."""
        found = np.stack([self.draws[name].values.ravel() for name in self.names])
        shape = [self.names.index(name) for name in self.of_contour]
        with np.errstate(invalid="ignore"):
            alike = np.abs(np.atleast_2d(np.corrcoef(found))[shape]).max(axis=0)
        names = self._with_the_contour(-np.nan_to_num(alike))
        side = 1.5 + 1.15 * len(names)
        axes = _plain_panels(len(names), len(names), side, side, 1.35, lower=True, hspace=0.08, wspace=0.08)
        plotting.pairs(self.result, names=names, axes=axes)
        axes[0, 0].figure.align_labels(list(axes[:, 0]) + list(axes[-1]))
        return axes

    def _with_the_contour(self, rank: Floats) -> list[str]:
        """Return the contour's parameters, and those of least rank among the others, in their order."""
        others = [self.names[k] for k in np.argsort(rank, kind="stable") if self.names[k] not in self.of_contour]
        chosen = {*self.of_contour, *others[: max(0, _MOST_PARAMETERS - len(self.of_contour))]}
        return [name for name in self.names if name in chosen]


def _plain_panels(
    rows: int,
    columns: int,
    width: float,
    height: float,
    below: float,
    *,
    above: float = 0.1,
    left: float = 1.35,
    lower: bool = False,
    **grid: Any,
) -> Any:
    """Return Axes of a new figure with given margins [inches]: to fit those of many Axes takes longer than to draw.

    With `lower` there are none above the diagonal.
    """
    from matplotlib.figure import Figure

    grid |= {"left": left / width, "right": 1.0 - 0.15 / width, "bottom": below / height, "top": 1.0 - above / height}
    figure = Figure(figsize=(width, height))
    places, axes = figure.add_gridspec(rows, columns, **grid), np.full((rows, columns), None)
    for row, column in np.ndindex(rows, columns):
        if not (lower and column > row):
            axes[row, column] = figure.add_subplot(places[row, column])
    return axes
