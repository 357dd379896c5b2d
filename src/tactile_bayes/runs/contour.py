"""A run: everything that is made of one record, in one folder."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import xarray as xr

from tactile_bayes.checks import check_probability
from tactile_bayes.contours import Contour
from tactile_bayes.contours.families import family_named
from tactile_bayes.errors import InferenceError, TactileBayesError
from tactile_bayes.files import write_atomically
from tactile_bayes.inference.contour import contours_of, infer_contour
from tactile_bayes.inference.ensembles import Progress, SamplerSettings
from tactile_bayes.inference.found_rig import found_rig
from tactile_bayes.inference.nuisances import STANDARD
from tactile_bayes.inference.result import posterior_draws, write_result
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.reconstruction import reconstruct
from tactile_bayes.record import CHANNELS, present_channels, rod_of, validate, with_rod
from tactile_bayes.rod import Rod
from tactile_bayes.runs.picture import write_picture
from tactile_bayes.scanning import Scan, scan
from tactile_bayes.uncertainty.band import contour_band
from tactile_bayes.uncertainty.gap import gap
from tactile_bayes.uncertainty.predictive import predictive_interval
from tactile_bayes.uncertainty.suspicions import suspicions
from tactile_bayes.uncertainty.verdicts import verdicts

__all__ = ["Run", "analyse", "contact_points", "reach", "summary"]

_DIRECTIONS: tuple[Literal["forward"], Literal["backward"]] = ("forward", "backward")


@dataclass(frozen=True)
class Run:
    """What `analyse` made.

    Attributes
    ----------
    posterior : xr.DataTree
    contacts : xr.Dataset or None
        Most likely contact points (raw Step 2 for Student's t with 2 degrees of freedom and fewer); None where a load
        channel is missing.
    band : xr.Dataset or None
    summary : xr.Dataset
        From `summary`.
    verdicts : tuple of str
        What is wrong, the most serious first, or that all is well; see `tactile_bayes.verdicts`. Last, what is left
        out, and why.
    files : mapping of str to Path
        By what they hold.
    left_out : mapping of str to Exception
        What could not be made of the posterior, and how it failed. What these are is None, or among no files.
    """

    posterior: xr.DataTree
    contacts: xr.Dataset | None
    band: xr.Dataset | None
    summary: xr.Dataset
    verdicts: tuple[str, ...]
    files: Mapping[str, Path]
    left_out: Mapping[str, Exception]


class _LeftOut(dict[str, Exception]):
    """What could not be made of a posterior, and how it failed."""

    @contextmanager
    def if_it_fails(self, what: str, path: Path) -> Iterator[None]:
        """Whatever goes wrong inside is noted under this name, and no file of a former run stays in its place."""
        try:
            yield
        except Exception as error:
            self[what] = error
            path.unlink(missing_ok=True)

    @property
    def words(self) -> tuple[str, ...]:
        """A sentence for each."""
        return tuple(
            f"Left out: {what}. {error}"
            if isinstance(error, TactileBayesError)
            else f"Left out: {what}. Unexpected error, {type(error).__name__}: {str(error) or 'no message'}"
            for what, error in self.items()
        )


def analyse(
    measured: xr.Dataset,
    out: str | os.PathLike[str],
    *,
    family: str = "parabola",
    load_cell: LoadCell | None = None,
    rod: Rod | None = None,
    friction: float | None = None,
    nuisances: Sequence[str] = STANDARD,
    probability: float = 0.95,
    seed: int = 1,
    settings: SamplerSettings | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    truth: Contour | None = None,
    record_file: str | os.PathLike[str] | None = None,
    command: Sequence[str] = (),
    progress: Callable[[Progress], object] | None = None,
) -> Run:
    """Contact points, contour posterior, band and figures of a record, written to a folder.

    The posterior is written as soon as it is drawn, and again with what it predicts. Whatever fails from then on is
    left out and named, and all else is made.

    Parameters
    ----------
    measured : xr.Dataset
        A record.
    out : path-like
        Folder for posterior.nc, contacts.csv, band.csv, summary.txt (which begins with the verdicts), summary.csv and
        the figures; made if it is not there. Files of these names in it are replaced, and a report.html, which would
        be of the posterior that was there, is removed.
    family, load_cell, rod, friction, nuisances, seed, settings, checkpoint, progress
        As `infer_contour` takes them.
    probability : float
        Of the band and of the intervals in the summary.
    truth : Contour, optional
        Drawn into the figures.
    record_file : path-like, optional
        The file that the record was read from, whose name and SHA-256 the posterior then states.
    command : sequence of str
        The words of the command that asked for this run, likewise.

    Returns
    -------
    Run

    Raises
    ------
    RecordError, ParameterError, InferenceError
        As `infer_contour`; where no contour is found, with what speaks for a wrong unit or sign.
    """
    check_probability("probability", probability)
    measured = with_rod(validate(measured), rod)
    origin = _origin(measured, probability, record_file, command)
    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    files = {"posterior": folder / "posterior.nc"}
    left_out, drawn = _LeftOut(), list[xr.DataTree]()

    def keep(posterior: xr.DataTree) -> None:
        posterior.attrs |= origin
        (folder / "report.html").unlink(missing_ok=True)  # before, so that it is never beside another posterior
        write_result(posterior, files["posterior"])
        drawn.append(posterior)

    try:
        keep(
            infer_contour(
                measured,
                family=family,
                load_cell=load_cell,
                seed=seed,
                friction=friction,
                nuisances=nuisances,
                settings=settings,
                checkpoint=checkpoint,
                progress=progress,
                keep=keep,
            )
        )
    except Exception as error:
        if not drawn and isinstance(error, InferenceError):
            raise type(error)(" ".join((str(error), *suspicions(measured, load_cell)))) from error
        if not drawn:
            raise
        left_out["predictions"] = error
    result = drawn[-1]

    contacts, band, edges, found = None, None, None, tuple[str, ...]()
    with left_out.if_it_fails("contacts", folder / "contacts.csv"):
        contacts = contact_points(measured, load_cell, result)
        if contacts is not None:
            _write_table(contacts.to_dataframe(), folder / "contacts.csv")
            files["contacts"] = folder / "contacts.csv"
    with left_out.if_it_fails("band", folder / "band.csv"):
        band = contour_band(result, reach(result), probability)
        _write_table(band.to_dataframe(), folder / "band.csv")
        files["band"] = folder / "band.csv"
    with left_out.if_it_fails("gap", folder / "gap.png"):
        edges = _gap(result, probability)
    with left_out.if_it_fails("verdicts", folder / "summary.txt"):
        found = verdicts(result, contacts)
    numbers = _summary(result, probability, edges)

    def write_summary() -> None:
        files["verdicts"], files["summary"] = folder / "summary.txt", folder / "summary.csv"
        table = numbers.to_dataframe()
        with write_atomically(files["verdicts"]) as temporary:
            text = (*found, *left_out.words, "", table.to_string(), "", str(result.attrs["message"]), "")
            temporary.write_text("\n".join(text), encoding="utf-8")
        _write_table(table, files["summary"])

    write_summary()
    before = len(left_out)
    files |= _draw(measured, result, contacts, band, edges, folder, left_out, truth=truth)
    if len(left_out) > before:
        write_summary()
    return Run(result, contacts, band, numbers, (*found, *left_out.words), files, left_out)


def _origin(
    measured: xr.Dataset, probability: float, record_file: str | os.PathLike[str] | None, command: Sequence[str]
) -> dict[str, Any]:
    """Attributes that say what a run was made from, and how it was asked for."""
    said = {
        str(name): value.item() if isinstance(value, np.generic) else value
        for name, value in measured.attrs.items()
        if not str(name).startswith(("rod_", "load_cell_")) and name != "units"
    }
    origin: dict[str, Any] = {"probability": probability, "record_attributes": json.dumps(said, default=str)}
    if command:
        origin["command"] = json.dumps(list(command))
    if record_file is not None:
        path = Path(record_file)
        origin |= {"record_file": path.name, "record_file_sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
    return origin


def contact_points(measured: xr.Dataset, load_cell: LoadCell | None, posterior: xr.DataTree) -> xr.Dataset | None:
    """The contact points of a run: Step 2, with the rig that was found: noise, biases, stiffness, offset, friction.

    Parameters
    ----------
    measured : xr.Dataset
        The record.
    load_cell : LoadCell or None
        As `infer_contour` was given it.
    posterior : xr.DataTree
        What that made of the record.

    Returns
    -------
    xr.Dataset or None
        From `reconstruct`; None where a load channel is missing.
    """
    if set(present_channels(measured)) != set(CHANNELS):
        return None
    rig = found_rig(measured, load_cell, posterior)
    return reconstruct(
        rig.record,
        method="constrained" if rig.load_cell.has_variances else "raw",
        load_cell=rig.load_cell,
        friction=rig.friction,
        suspension_compliance=rig.suspension_compliance,
    )


def summary(posterior: xr.DataTree, probability: float = 0.95) -> xr.Dataset:
    """Median, central interval, R̂ and effective sample size of every parameter, and the gap where there is one.

    Parameters
    ----------
    posterior : xr.DataTree
        From `infer_contour`.
    probability : float
        Of the central interval.

    Returns
    -------
    xr.Dataset
        Over "quantity": median, lower, upper, r_hat, ess_bulk, ess_tail, unit.
    """
    return _summary(posterior, probability, _gap(posterior, probability))


def _gap(posterior: xr.DataTree, probability: float) -> xr.Dataset | None:
    """The gap, if there are sweeps of both directions."""
    both = set(_events(posterior).stroke.values) == set(_DIRECTIONS)
    return gap(posterior, probability) if both else None


def _events(posterior: xr.DataTree) -> xr.Dataset:
    if "events" not in posterior.children:
        raise InferenceError("the posterior holds no events: first contacts and snap-offs of its contours are missing")
    return posterior["events"].to_dataset()


def _summary(posterior: xr.DataTree, probability: float, edges: xr.Dataset | None) -> xr.Dataset:
    """`summary`, with a gap that is there already."""
    draws, stats = posterior_draws(posterior), posterior["sample_stats"].to_dataset()
    levels = [0.5 * (1.0 - probability), 0.5, 0.5 * (1.0 + probability)]
    rows: list[tuple[Any, ...]] = []
    for name in stats.parameter.values:
        lower, median, upper = np.quantile(draws[name], levels)
        diagnostics = (float(stats[d].sel(parameter=name)) for d in ("r_hat", "ess_bulk", "ess_tail"))
        rows.append((name, median, lower, upper, *diagnostics, draws[name].attrs["units"]))
    if edges is not None:
        width = edges["width"]
        values = (float(width.sel(bound=b)) for b in ("median", "lower", "upper"))
        rows.append(("gap width", *values, np.nan, np.nan, np.nan, width.attrs["units"]))
    quantity, *columns = zip(*rows, strict=True)
    names = ("median", "lower", "upper", "r_hat", "ess_bulk", "ess_tail", "unit")
    return xr.Dataset(
        {name: ("quantity", list(column)) for name, column in zip(names, columns, strict=True)},
        coords={"quantity": list(quantity)},
        attrs={"probability": probability},
    )


def reach(result: xr.DataTree) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Values of x from one end of what the rod touched to the other, where a run has its band; shape (201,).

    Draws without an event do not count.
    """
    events = _events(result)
    x = np.concatenate([events[f"{when}_contact_x"].values.ravel() for when in ("first", "snap_off")])
    if not np.isfinite(x).any():
        raise InferenceError("the rod touches none of the posterior's contours: there is no stretch of it to tell of")
    lo, hi = np.nanquantile(x, [0.05, 0.95])
    return np.linspace(lo, hi, 201)


def _write_table(table: Any, path: Path) -> None:
    with write_atomically(path) as temporary:
        table.to_csv(temporary)


def _draw(
    measured: xr.Dataset,
    result: xr.DataTree,
    contacts: xr.Dataset | None,
    band: xr.Dataset | None,
    edges: xr.Dataset | None,
    folder: Path,
    left_out: _LeftOut,
    *,
    truth: Contour | None,
) -> dict[str, Path]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from tactile_bayes import plotting
    from tactile_bayes.plotting.maps import set_below

    files: dict[str, Path] = {}
    draws = posterior_draws(result)
    strokes = list(result["events"].stroke.values) if "events" in result.children else []
    directions: list[Literal["forward", "backward"]] = [d for d in _DIRECTIONS if d in strokes]
    base = float(measured.base_x[0]), float(measured.base_y[0])

    def panels(rows: int, columns: int, width: float, height: float, **options: Any) -> tuple[Any, Any]:
        figure = Figure(figsize=(width, height), layout="constrained")
        return figure, figure.subplots(rows, columns, squeeze=False, **options)

    @cache
    def fitted() -> Scan:
        best = result["sample_stats"]["lp"].argmax(("chain", "draw"))  # medians by parameter may be out of reach
        likeliest = contours_of(draws.isel(best), result.attrs["family"]).take(np.array(0))
        return scan(
            likeliest,
            direction="both" if len(directions) == 2 else directions[0],
            base=base,
            rod=rod_of(measured),
            friction=float(draws.isel(best).get("friction", result.attrs["friction"])),
        )

    def observables() -> Any:
        figure, axes = panels(3, 1, 7.0, 5.4, sharex=True)
        plotting.observables(measured, events=fitted().events, axes=axes[:, 0])
        return figure

    def predictive() -> Any:
        figure, axes = panels(6, 1, 7.0, 8.4, sharex=True, height_ratios=3 * (2.0, 1.0))
        probability = float(result.attrs["probability"])
        interval = predictive_interval(result, probability)
        label = f"{100 * probability:.6g} % predictive"
        plotting.predictive(measured, interval, axes=axes[::2, 0], residuals=axes[1::2, 0], label=label)
        figure.align_ylabels(axes[:, 0])
        return figure

    def rods() -> Any:
        figure, axes = panels(len(directions), 1, 7.0, 4.0 * len(directions))
        for direction, ax in zip(directions, axes[:, 0], strict=True):
            plotting.rods(fitted(), direction=direction, ax=ax)
        return figure

    def contour() -> Any:
        if band is None:
            raise InferenceError("there is no band to be drawn")
        figure, axes = panels(2, 1, 7.0, 6.0, sharex=True, height_ratios=(2.6, 1.0))
        plotting.contour(band.x.values, truth=truth, contacts=contacts, band=band, gap=edges, base=base, ax=axes[0, 0])
        plotting.band_detail(band, truth=truth, gap=edges, ax=axes[1, 0])
        axes[0, 0].set_xlabel("")
        set_below(*axes[:, 0])
        return figure

    mute = family_named(result.attrs["family"]).roughness
    names = [str(name) for name in draws.data_vars if name not in mute]

    def trace() -> Any:
        figure, axes = panels(len(names), 2, 7.0, 1.6 * len(names))
        plotting.trace(result, names=names, axes=axes)
        return figure

    def pairs() -> Any:
        figure, axes = panels(len(names), len(names), 1.6 * len(names) + 0.6, 1.6 * len(names) + 0.6)
        plotting.pairs(result, names=names, axes=axes)
        return figure

    figures: list[Callable[[], Any]] = [observables, predictive, rods, contour, trace, pairs]
    if edges is not None:

        def gap() -> Any:
            figure, axes = panels(1, 1, 7.0, 3.6)
            plotting.gap(edges, truth=truth, ax=axes[0, 0])
            return figure

        figures.insert(4, gap)
    for draw in figures:
        name = draw.__name__
        with left_out.if_it_fails(f"figure {name}", folder / f"{name}.png"):
            figure = draw()
            FigureCanvasAgg(figure)
            write_picture(figure, folder / f"{name}.png")
            files[name] = folder / f"{name}.png"
    return files
