"""The analysis of many records of one rig: a folder of a run for each, and one table of all."""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.checks import check_path, check_probability, check_switch, refused
from tactile_bayes.errors import ParameterError, TactileBayesError
from tactile_bayes.inference.ensembles import SamplerSettings, settings_of
from tactile_bayes.inference.family import Family, family_of
from tactile_bayes.numerics.random_numbers import Rng, seed_sequence, seed_words
from tactile_bayes.record.bag import is_bag
from tactile_bayes.record.netcdf import read_netcdf
from tactile_bayes.rig import read_record
from tactile_bayes.rig.rig import Rig, rig_of
from tactile_bayes.runs.contour import analyse
from tactile_bayes.runs.folder import Folder
from tactile_bayes.runs.names import INFERENCE, MANY
from tactile_bayes.tasks import (
    TaskProgress,
    Workers,
    errors_of,
    refuse_replacing,
    run_tasks,
    workers_of,
    write_atomically,
)
from tactile_bayes.tasks.documents import read_json
from tactile_bayes.tasks.results_store import differences

ROW = "run.json"  # file with the row of a run in the table of all, written when the run is complete
_SUFFIXES = (".csv", ".nc", ".mcap", ".bag", ".db3")


@dataclass(frozen=True)
class _Task:
    """A record to be analysed."""

    path: Path
    out: Path
    rig: Rig
    family: Family
    seed: np.random.SeedSequence
    settings: SamplerSettings
    probability: float
    figures: bool

    @property
    def identity(self) -> dict[str, str]:
        """Everything that determines the run, as text."""
        return {
            "record": _digest(self.path),
            "rig": self.rig.text,
            "family": repr(self.family),
            "seed": seed_words(self.seed),
            "settings": json.dumps(asdict(self.settings)),
            "probability": repr(self.probability),
            "version": version("tactile-bayes"),
        }


def infer_contours(
    records: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    rig: Rig | None = None,
    *,
    out: str | os.PathLike[str],
    family: Family | str = "parabola",
    rng: Rng,
    settings: SamplerSettings | None = None,
    probability: float = 0.95,
    figures: bool = True,
    workers: int | str | Workers | None = None,
) -> xr.Dataset:
    """Infer the contours of many records of one rig, each into a folder of its own, and return one table of all.

    Each record is inferred as by `infer_contour`, with the same seed. A record that fails is a row with the reason. A
    run that is complete and was made from the same record, rig, family, seed and settings is not made again, so that a
    stopped call goes on where it was, and records may be added: the table has the runs of earlier calls as well. No run
    is replaced.

    Parameters
    ----------
    records : path-like or sequence of path-like
        Files of records, or a folder of them.
    rig : Rig, optional
        The rig, and how it writes its files.
    out : path-like
        Folder for a folder of each record, by the name of its file, with that of the file's folder before it if a run
        of another record has this name; and for runs.csv and runs.nc, the table; created if missing.
    family, rng, settings
        As in `infer_contour`.
    probability : float
        Probability of bands and intervals, in (0, 1).
    figures : bool
        If False, none are drawn, which saves two seconds of each record; a report has its own.
    workers
        As in `calibrate`.

    Returns
    -------
    xr.Dataset
        By `record` (names of the folders): `verdict`, the first message of `check`, `converged`, `error` (the reason
        of a failure, else ""), `seconds`, `band_width` (median over what was touched), and by
        `quantity` the `median`, `lower` and `upper` end of the interval, with `unit`; NaN where a record has none.

    Raises
    ------
    ParameterError
        If an argument is not valid, there are no records, or a run would replace one of them; or if the folder holds a
        run of one of the records that was made with another rig, family, seed, settings, probability or version.
    TaskError
        As in `run_tasks`.

    Examples
    --------
    >>> import tempfile
    >>> from tactile_bayes import LoadCell, scan, write_record
    >>> from tactile_bayes.contours import paper_profile
    >>> cell = LoadCell(force_noise=0.05, moment_noise=0.02)
    >>> measured = cell.measure(scan(paper_profile("II", q=0.5), drive_step=0.1).record, rng=1)
    >>> settings = SamplerSettings(min_ess=100, max_r_hat=1.1)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path, out = Path(folder) / "one.csv", Path(folder) / "runs"
    ...     write_record(measured, path)
    ...     table = infer_contours([path], Rig(unknown="nothing"), out=out, rng=1, settings=settings, figures=False)
    >>> table["record"].values.tolist(), table["error"].item()
    (['one'], '')
    """
    paths, folder = records_in(records), check_path("out", out, "give the path of a folder")
    check_probability("probability", probability)
    workers = workers_of(workers)
    names, failed = _names(paths, folder), _failures_in(folder)
    refuse_replacing((folder / name for name in MANY), paths)
    made = (rig_of(rig), family_of(family), seed_sequence(rng), settings_of(settings), probability)
    check_switch("figures", figures)
    tasks = [_Task(path, folder / name, *made, figures) for path, name in zip(paths, names, strict=True)]
    rows = {task.out.name: row for task in tasks if (row := _kept(task)) is not None}
    began, left = time.monotonic(), [task for task in tasks if task.out.name not in rows]
    with closing(run_tasks(_analysed, left, workers=workers)) as results:
        for count, (task, row) in enumerate(results, start=1):
            rows[task.out.name] = row
            if workers.progress is not None:
                done = len(tasks) - len(left) + count
                workers.progress(TaskProgress(done, len(tasks), count, time.monotonic() - began))
    complete = {path.parent.name: _stored(path.parent) for path in sorted(folder.glob(f"*/{ROW}"))}
    others = {**failed, **{name: run["row"] for name, run in complete.items() if run is not None}}
    others = {name: row for name, row in others.items() if name not in rows}
    table = _table({**others, **{name: rows[name] for name in names}})
    with Folder(folder, MANY) as written:
        written.write_netcdf("table", "runs.nc", table)
        written.write_table("table as text", "runs.csv", _flat(table))
    return table


def records_in(records: str | os.PathLike[str] | Iterable[str | os.PathLike[str]]) -> list[Path]:
    """Return the files of records, of a folder those with the suffix of a record."""
    correction = "give files of records, or a folder of them"
    if not isinstance(records, str | os.PathLike | Iterable):
        raise refused("records", records, correction)
    given = [records] if isinstance(records, str | os.PathLike) else list(records)
    found: list[Path] = []
    for each in given:
        path = check_path("records", each, correction)
        if path.is_dir() and not is_bag(path):
            inside = sorted(file for file in path.iterdir() if file.suffix.lower() in _SUFFIXES or is_bag(file))
            if not inside:
                raise ParameterError(f"{path} holds no record: give a folder of .csv, .nc or .mcap files")
            found += inside
        else:
            found.append(path)
    if not found:
        raise ParameterError("there are no records: give files, or a folder of them")
    return found


def _names(paths: Sequence[Path], folder: Path) -> list[str]:
    """Return a name for each record: that of its run in the folder, or a free one."""
    stems, names = Counter(path.stem.casefold() for path in paths), list[str]()  # some systems do not tell A from a
    for path in paths:
        record = _digest(path) if path.exists() else ""
        own = [path.stem, f"{path.resolve().parent.name}-{path.stem}"]
        stored = [_stored(folder / name) for name in own]
        done = [name for name, run in zip(own, stored, strict=True) if run and run["identity"]["record"] == record]
        free = [name for name in own[stems[path.stem.casefold()] > 1 :] if not (folder / name / INFERENCE[0]).exists()]
        taken = {name.casefold() for name in names}
        name = next((name for name in (*done, *free) if name.casefold() not in taken), None)
        if name is None:
            raise ParameterError(
                f"other records are called {own[0]} and {own[1]}, or {path} is given twice: rename one, since each has "
                "a folder of its name"
            )
        names.append(name)
    return names


def _stored(run: Path) -> dict[str, Any] | None:
    """Return identity and row of a run that is complete; None if there is none."""
    try:
        stored = read_json((run / ROW).read_bytes(), ROW)
        is_whole = isinstance(stored["identity"]["record"], str) and isinstance(stored["row"]["seconds"], int | float)
    except (OSError, ParameterError, KeyError, TypeError):
        return None
    return dict(stored) if is_whole and (run / INFERENCE[0]).is_file() else None


def _kept(task: _Task) -> dict[str, Any] | None:
    """Return the row of a run that is complete and the same; None if it is to be made."""
    stored = _stored(task.out)
    if stored is None:
        return None
    if differ := differences(stored["identity"], task.identity):
        raise ParameterError(
            f"{task.out} was made otherwise: {differ}; give another folder (--out), or remove this one to make it again"
        )
    row: dict[str, Any] = stored["row"]
    return row


def _failures_in(folder: Path) -> dict[str, dict[str, Any]]:
    """Return the rows of the table of a folder that have the reason of a failure."""
    path, correction = folder / MANY[1], "remove it, the runs beside it stay"
    if not path.exists():
        return {}
    table = read_netcdf(path, xr.open_dataset, lambda what: ParameterError(f"{path} {what}: {correction}"))
    if not {"record", "error", "seconds"} <= set(table.variables):
        raise ParameterError(f"{path} is no table of runs: give another folder, or {correction}")
    columns = (table[name].values.tolist() for name in ("record", "error", "seconds"))
    return {name: {"error": error, "seconds": took} for name, error, took in zip(*columns, strict=True) if error}


def _analysed(task: _Task) -> dict[str, Any]:
    """Analyse a record, and return its row; keep it beside the run if it is complete."""
    began = time.monotonic()
    try:
        identity = task.identity
        measured = read_record(task.path, task.rig)
        run = analyse(
            measured,
            task.out,
            rig=task.rig.without_bare_cell,
            family=task.family,
            probability=task.probability,
            rng=task.seed,
            settings=task.settings,
            record_file=task.path,
            figures=task.figures,
        )
    except (TactileBayesError, OSError) as error:
        return {"error": _reason(error), "seconds": time.monotonic() - began}
    if run.is_interrupted:  # it is no result, and is made again
        raise KeyboardInterrupt
    numbers = run.summary
    width = float("nan") if run.band is None else float((run.band.upper - run.band.lower).median())
    row = {
        "verdict": run.messages[0],
        "converged": bool(run.posterior.attrs["converged"]),
        "error": "",
        "seconds": time.monotonic() - began,
        "band_width": width,
        "quantities": {
            str(name): [float(numbers[part].sel(quantity=name)) for part in ("median", "lower", "upper")]
            for name in numbers.quantity.values
        },
        "units": {str(name): str(numbers["unit"].sel(quantity=name).values) for name in numbers.quantity.values},
    }
    text = json.dumps({"identity": identity, "row": row}, indent=1)
    with errors_of(task.out / ROW), write_atomically(task.out / ROW) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return row


def _reason(error: Exception) -> str:
    """Return why a record failed, in words."""
    if isinstance(error, FileNotFoundError) and error.filename:
        return f"there is no file {os.fspath(error.filename)}: correct its path"
    return str(error)


def _digest(path: Path) -> str:
    """Return the SHA-256 of a file, or of the names and contents of the files of a folder."""
    files = sorted(file for file in path.rglob("*") if file.is_file()) if path.is_dir() else [path]
    digest = hashlib.sha256()
    for file in files:
        digest.update(str(file.relative_to(path)).encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()


def _table(rows: Mapping[str, Mapping[str, Any]]) -> xr.Dataset:
    quantities = list(dict.fromkeys(name for row in rows.values() for name in row.get("quantities", {})))
    none = [float("nan")] * 3
    numbers = np.array(
        [[row.get("quantities", {}).get(name, none) for name in quantities] for row in rows.values()], dtype=float
    ).reshape(len(rows), len(quantities), 3)
    units = {name: unit for row in reversed(list(rows.values())) for name, unit in row.get("units", {}).items()}
    defaults = {"verdict": "", "converged": False, "error": "", "seconds": none[0], "band_width": none[0]}
    columns: dict[str, Any] = {
        **{name: ("record", [row.get(name, value) for row in rows.values()]) for name, value in defaults.items()},
        **{part: (("record", "quantity"), numbers[..., i]) for i, part in enumerate(("median", "lower", "upper"))},
        "unit": ("quantity", [units.get(name, "1") for name in quantities]),
    }
    return xr.Dataset(columns, coords={"record": list(rows), "quantity": quantities})


def _flat(table: xr.Dataset) -> xr.Dataset:
    """Return the table with three columns for each quantity."""
    columns = {
        f"{name}{suffix}": table[part].sel(quantity=name, drop=True)
        for name in table.quantity.values.tolist()
        for part, suffix in (("median", ""), ("lower", "_lower"), ("upper", "_upper"))
    }
    return table.drop_dims("quantity").assign(columns)
