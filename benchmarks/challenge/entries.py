"""Answers the challenge by the methods of this package: `python -m benchmarks.challenge.entries METHOD ANSWERS/`.

METHOD is infer, laplace, raw or constrained; numbers of records may follow, by default all. Records that have an answer
are left alone, so that a run resumes.
"""

from __future__ import annotations

import csv
import sys
import tarfile
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import xarray as xr

import tactile_bayes as tb
from benchmarks.challenge.score import COLUMNS, HERE, PROBABILITY, RECORDS, STEP
from tactile_bayes.arrays import Floats
from tactile_bayes.assessment.split_prediction import Linearisation
from tactile_bayes.errors import InferenceError, TactileBayesError
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.starts.contour_optimum import optima_of
from tactile_bayes.tasks import one_thread, write_atomically

FARTHEST = 120  # number of the last grid point on either side
DEVIATIONS = 1.6448536269514722  # of a normal distribution, in which it has the probability on either side
SETTINGS = tb.SamplerSettings(max_seconds=180.0)
SEED = 1

Answer = tuple[Any, Any, Any, str]  # lower, middle and upper heights, and what the method says of them


def infer(record: xr.Dataset, rig: tb.Rig, family: str, x: Floats) -> Answer:
    posterior = tb.infer_contour(record, family=family, rig=rig, rng=SEED, settings=SETTINGS)
    return *band_of(posterior, x), tb.check(posterior).messages[0].partition(":")[0]


def laplace(record: xr.Dataset, rig: tb.Rig, family: str, x: Floats) -> Answer:
    """Draw from the normal distribution about the best fit, of logarithms where parameters are positive."""
    model = Experiment(record, rig, family).model
    rng = np.random.default_rng(SEED)
    tried = []
    for one in islice(optima_of(model, rng), 9):
        tried.append(one)
        if one.fits:
            break
    best, positive = min(tried, key=lambda one: one.cost), model.coordinates.positive
    scales = np.sqrt(np.diag(best.covariance)) * np.where(positive, best.point, 1.0)
    (fit,) = Linearisation(model, scales).fits(model.likelihood.measured[None], best.point[None])
    if fit is None:
        raise InferenceError("the best fit is at an end of what the rod reaches")
    size = len(model.forward_parameters)
    off = rng.multivariate_normal(np.zeros(size), fit.covariance, 4000) * scales[:size]
    point, positive = best.point[:size], positive[:size]
    drawn = np.where(positive, point * np.exp(np.where(positive, off / point, 0.0)), point + off)
    columns = {n: (("chain", "draw"), of[None]) for n, of in zip(model.forward_parameters, drawn.T, strict=True)}
    tree = xr.DataTree.from_dict({"posterior": xr.Dataset(columns)})
    tree.attrs = {"family": family, "units": record.attrs["units"]}
    return *band_of(tree, x), ""


def band_of(posterior: xr.DataTree, x: Floats) -> tuple[Any, Any, Any]:
    band = tb.contour_band(posterior, x, PROBABILITY)
    return band.lower.values, band["median"].values, band.upper.values


def step2(record: xr.Dataset, rig: tb.Rig, family: str, x: Floats, *, method: Any) -> Answer:
    """Join the contacts of a tared record by straight lines; bands are those of single contacts."""
    tared = tb.LoadCell.from_zero_load(record)
    cell = replace(rig.load_cell or tared, bias=tared.bias)
    contacts = tb.reconstruct(record, replace(rig, load_cell=cell), method=method)
    contacts = contacts.isel(sample=contacts.status.values == "ok").sortby("contact_x")
    if not contacts.sizes["sample"]:
        raise InferenceError("no sample has a contact")
    half = DEVIATIONS * contacts.normal_sd / np.abs(np.cos(contacts.slope_angle))
    middle, half = (
        np.interp(x, contacts.contact_x, each, left=np.nan, right=np.nan) for each in (contacts.contact_y, half)
    )
    return middle - half, middle, middle + half, ""


METHODS: dict[str, Callable[[xr.Dataset, tb.Rig, str, Floats], Answer]] = {
    "infer": infer,
    "laplace": laplace,
    "raw": partial(step2, method="raw"),
    "constrained": partial(step2, method="constrained"),
}


def answer(folder: Path, row: dict[str, str], method: str) -> str:
    """Return the answer on a record as the text of its file."""
    x = STEP * float(row["length_m"]) * np.arange(-FARTHEST, FARTHEST + 1)
    family = row["object"].replace("any", "shape-free")
    began = time.perf_counter()
    try:
        rig = tb.Rig.read(folder / "rig.toml")
        *bands, said = METHODS[method](tb.read_record(folder / "record.csv", rig), rig, family, x)
    except TactileBayesError as error:
        bands, said = [np.full(x.size, np.nan)] * 3, f"{type(error).__name__} {error}".partition("\n")[0]
    lines = [f"# seconds: {time.perf_counter() - began:.3g}", f"# {said}", ",".join(COLUMNS)]
    for place, *heights in zip(x, *bands, strict=True):
        known = np.isfinite(heights).all()
        lines.append(",".join([f"{place:.6g}", *(f"{height:.6g}" if known else "" for height in heights)]))
    return "\n".join(lines) + "\n"


def main(method: str, out: Path, numbers: list[str]) -> None:
    out.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as folder, one_thread():
        with tarfile.open(HERE / RECORDS) as archive:
            archive.extractall(folder, filter="data")
        records = Path(folder) / "records"
        with open(records / "objects.csv", encoding="utf-8", newline="") as file:
            rows = {row["record"]: row for row in csv.DictReader(file)}
        for number in numbers or rows:
            path = out / f"{number}.csv"
            if not path.exists():
                text = answer(records / number, rows[number], method)
                with write_atomically(path) as temporary:
                    temporary.write_text(text, encoding="utf-8")
                print(*text.splitlines()[:2], path.name, flush=True)


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), sys.argv[3:])
