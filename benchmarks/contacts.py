"""Prints errors of contact points, and the coverage of their regions."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.special import chdtr
from scipy.stats import binom
from threadpoolctl import threadpool_limits

import tactile_bayes as tb
from benchmarks.table import line
from tactile_bayes.arrays import Floats
from tactile_bayes.contours import Circle, Contour, Ellipse, Parabola, PowerLaw
from tactile_bayes.planning.amplification import along_and_across
from tactile_bayes.rig import make_record
from tactile_bayes.sweep import scan_many
from tactile_bayes.tasks import one_thread

REFERENCE = Path(__file__).parents[1] / "data" / "synthetic" / "reference"
CELL = tb.LoadCell(force_noise=0.05, moment_noise=0.02)
METHODS = ("raw", "constrained")
PROBABILITIES = (0.5, 0.9, 0.95)
PHASES = ("tip", "tangential")
PLACES = {"first 5 % of the sweep": (0.0, 0.05), "in between": (0.05, 0.95), "last 5 % before snap-off": (0.95, 1.0)}
# Shapes, with the ranges of their own parameters.
SHAPES: list[Any] = [
    (Parabola, (0.3, 1.5)),
    (Circle, (0.4, 1.5)),
    (Ellipse, (0.4, 1.5), (0.4, 1.5)),
    (PowerLaw, (0.5, 1.5), (1.5, 4.0)),
]
SAMPLES = {"first 5 % of the sweep": 4, "in between": 12, "last 5 % before snap-off": 4}  # contacts taken of each sweep


def main(sweeps: int = 1000) -> None:
    with threadpool_limits(1), one_thread():
        print("Root-mean-square error of contact points, in rod lengths, on the reference data set:\n")
        print_errors()
        print(f"\nHow many regions hold the true contact, of {sweeps:,} sweeps:\n")
        print_coverage(sweeps)


def print_errors() -> None:
    """Print errors, raw and constrained, along and across the contour, by phase and noise."""
    heads = ("contacts", "no answer", "both ok", "raw: along", "across", "constrained: along", "across")
    print(line(f"{'noise of force [EI/L²]':<24}phase", heads, 36, 20))
    data = tb.datasets.open(REFERENCE)
    rows: dict[tuple[float, str], list[Floats]] = {}
    for index in range(data.sizes["record"]):
        record = tb.datasets.record(REFERENCE, index)
        noise = float(record.attrs["load_cell_force_noise"]) / tb.record.rod_of(record).force_unit
        length = float(record.attrs["rod_length"])
        raw, constrained = (tb.reconstruct(record, method=method) for method in METHODS)
        loaded = raw.status.values != "no contact"
        off = np.stack([error for each in (raw, constrained) for error in errors(each, record)]) / length
        answered = np.isin(raw.status.values, ("ok", "nonlinear"))
        ok = (raw.status.values == "ok") & (constrained.status.values == "ok")
        for phase in PHASES:
            chosen = loaded & (record.truth_contact_phase.values == phase)
            rows.setdefault((noise, phase), []).append(np.vstack([answered, ok, off])[:, chosen])
    for (noise, phase), parts in sorted(rows.items()):
        answered, ok, *off = np.concatenate(parts, axis=1)
        cells = [f"{answered.size:,}", f"{1.0 - answered.mean():.1%}", f"{ok.mean():.1%}"]
        cells += [f"{np.sqrt(np.mean(error[ok == 1.0] ** 2)):.4f}" for error in off]
        print(line(f"{noise:<24.3g}{phase}", cells, 36, 20))


def errors(contacts: xr.Dataset, record: xr.Dataset) -> tuple[Floats, Floats]:
    """Return errors along the true contour and across it."""
    x, y = (contacts[name].values - record[f"truth_{name}"].values for name in ("contact_x", "contact_y"))
    return along_and_across(x, y, record.truth_slope_angle.values)


def print_coverage(sweeps: int, seed: int = 1) -> None:
    """Print coverage by phase and part of the sweep; in brackets, that of exact regions in 95 of 100 studies."""
    found = coverage(sweeps, seed)
    print(line("", ("contacts", "status ok", *(f"{p:.0%}" for p in PROBABILITIES)), 39, 23))
    for name in (*METHODS, "posterior"):
        print(name)
        for phase in PHASES:
            for place in PLACES:
                chosen = (found["phase"] == phase) & (found["place"] == place)
                ok = chosen & found[f"{name} ok"].astype(bool)
                count = max(ok.sum(), 1)
                cells = [f"{np.count_nonzero(chosen):,}", f"{ok.sum() / max(chosen.sum(), 1):.1%}"]
                for p in PROBABILITIES:
                    share = float(np.mean(found[name][ok] <= p)) if ok.any() else np.nan
                    low, high = (float(q) / count for q in binom(ok.sum(), p).interval(0.95))
                    cells.append(f"{share:.3f} [{low:.3f}, {high:.3f}]")
                print(line(f"  {phase}, {place}", cells, 39, 23))


def coverage(sweeps: int, seed: int) -> dict[str, NDArray[np.generic]]:
    """Return the probability of the smallest region that holds the true contact, for contacts above the noise."""
    parts: list[dict[str, NDArray[np.generic]]] = []
    for number, truth in enumerate(records(sweeps, seed)):
        measured = CELL.measure(truth, rng=np.random.default_rng([seed, number]))
        held: dict[str, NDArray[np.generic]] = {}
        for method in METHODS:
            contacts = tb.reconstruct(measured, method=method)
            held[method] = chdtr(2.0, squared_distance(contacts, measured))
            held[f"{method} ok"] = contacts.status.values == "ok"
        loaded = np.flatnonzero(contacts.status.values != "no contact")
        posterior = tb.infer_contacts(measured, rng=seed, draws=400)["posterior"].to_dataset()
        held["posterior"] = np.full(measured.sizes["sample"], np.nan)
        held["posterior ok"] = np.ones(measured.sizes["sample"], dtype=bool)
        for i in loaded.tolist():
            place = measured.truth_contact_x.values[i], measured.truth_contact_y.values[i]
            held["posterior"][i] = tb.uncertainty.contact_region(posterior, i).least_probability(*place)
        held["phase"] = measured.truth_contact_phase.values
        of_sweep = np.repeat(list(PLACES), [SAMPLES[place] for place in PLACES])
        held["place"] = np.tile(of_sweep, measured.sizes["sample"] // of_sweep.size)
        parts.append({name: values[loaded] for name, values in held.items()})
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def squared_distance(contacts: xr.Dataset, record: xr.Dataset) -> Floats:
    """Return that of the true contact point from the estimate, in standard deviations; infinite without an estimate."""
    x = (record.truth_contact_x - contacts.contact_x).values / contacts.contact_x_sd.values
    y = (record.truth_contact_y - contacts.contact_y).values / contacts.contact_y_sd.values
    rho = contacts.contact_xy_correlation.values
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (x * x - 2.0 * rho * x * y + y * y) / (1.0 - rho * rho)
    return np.where(np.isfinite(distance) & (contacts.status.values != "beyond the tip"), distance, np.inf)


def records(sweeps: int, seed: int) -> Iterator[xr.Dataset]:
    """Yield records of 50 sweeps along as many contours, 20 contacts of each, forward and backward in turn."""
    rng = np.random.default_rng([seed, 2**32])
    for begin in range(0, sweeps, 50):
        count = min(50, sweeps - begin)
        yield record_of(contours(rng, begin // 50, 4 * count), "backward" if begin // 50 % 2 else "forward", count, rng)


def contours(rng: np.random.Generator, number: int, count: int) -> Contour:
    x_c, q = rng.normal(0.0, 0.1, count), rng.uniform(0.3, 0.7, count)
    shape, *ranges = SHAPES[number // 2 % len(SHAPES)]
    return shape(*(rng.uniform(low, high, count) for low, high in ranges), q, x_c)


def record_of(drawn: Contour, direction: str, count: int, rng: np.random.Generator) -> xr.Dataset:
    """Return a record of the first `count` contours that can be swept, at random drive angles of each sweep."""
    events = scan_many(drawn, np.full((drawn.shape[0], 1), np.pi / 2), direction=direction)
    good = np.flatnonzero(events.status.values == "ok")[:count]
    share = np.concatenate([rng.uniform(*PLACES[place], (count, SAMPLES[place])) for place in PLACES], axis=1)
    share = np.sort(share, axis=1)  # places follow one another
    first, last = (events[f"{when}_drive_angle"].values[good, None] for when in ("first_contact", "snap_off"))
    angles = first + (last - first) * share
    swept = scan_many(drawn.take(good), angles, direction=direction)
    readings = ("holding_moment", "force_x", "force_y", "drive_angle")
    truths = ("contact_x", "contact_y", "slope_angle", "contact_arclength", "contact_phase")
    columns = {name: swept[name].values.ravel() for name in readings}
    columns |= {f"truth_{name}": swept[name].values.ravel() for name in truths}
    columns["sweep"] = np.repeat(np.arange(count), angles.shape[1])
    columns["direction"] = np.full(angles.size, direction)
    return make_record(columns)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
