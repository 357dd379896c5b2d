"""Scores answers to the challenge, with Python and NumPy alone: `python score.py [--common] ANSWERS/ [ANSWERS/ ...]`.

README.md beside this file says what an answer is, and what is scored; with --common only records of which each of the
folders has a file.
"""

from __future__ import annotations

import csv
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).parent
RECORDS, TRUTH, SWEEPS = "records.tar.xz", "truth.json", "sweeps.csv"
STEP = 0.01  # of the grid points of x, over the length of the rod
PROBABILITY = 0.9
COLUMNS = ("x", "lower", "middle", "upper")
REGIONS = ("gap", "touched")


class AnswerError(ValueError):
    """What is not an answer: the message says in which file and line, and what is wanted."""


def interval_score(y: Any, lower: Any, upper: Any, probability: float = PROBABILITY) -> Any:
    """Return the interval score (Gneiting and Raftery 2007, doi 10.1198/016214506000001437, equation 43)."""
    missed = np.maximum(lower - y, 0.0) + np.maximum(y - upper, 0.0)
    return upper - lower + 2.0 / (1.0 - probability) * missed


def read_answer(path: Path, columns: tuple[str, ...] = COLUMNS) -> tuple[dict[str, list[float]], float]:
    """Return the answered rows, numbers by the text of their first column, and the seconds that are stated."""
    found, seconds, header = dict[str, list[float]](), np.nan, list[str]()
    for number, line in enumerate(path.read_text("utf-8-sig", "replace").splitlines(), start=1):
        where, cells = f"{path}, line {number}", [cell.strip() for cell in line.split(",")]
        if line.startswith("#"):
            name, _, value = line[1:].partition(":")
            seconds = _number(value, f"{where}, seconds") if name.strip() == "seconds" else seconds
        elif not header:
            header = cells
            if sorted(header) != sorted(columns):
                raise AnswerError(f"{where}: columns are {line!r}: give {','.join(columns)}")
        elif line.strip():
            if len(cells) != len(header):
                raise AnswerError(f"{where}: {len(cells)} cells below {len(header)} columns")
            key, *texts = (cells[header.index(name)] for name in columns)
            if key in found:
                raise AnswerError(f"{where}: {columns[0]} is {key} for the second time")
            if any(texts):
                found[key] = [_number(text, f"{where}, {name}") for name, text in zip(columns[1:], texts, strict=True)]
                if sorted(found[key]) != found[key]:
                    raise AnswerError(f"{where}: {','.join(texts)} do not increase: give lower, middle, upper")
    if not header:
        raise AnswerError(f"{path}: it is empty: give columns {','.join(columns)}")
    return found, seconds


def _number(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise AnswerError(f"{where}: {text.strip()!r} is no finite number")
    return value


def bands_of(path: Path, length: float) -> tuple[dict[int, list[float]], float]:
    """Return lower, middle and upper by number of the grid point, over the length of the rod; and the seconds."""
    rows, seconds = read_answer(path)
    found = {}
    for text, heights in rows.items():
        place = _number(text, f"{path}, x") / (STEP * length)
        if abs(place - round(place)) > 1e-3 or round(place) in found:
            raise AnswerError(f"{path}: x is {text}: give multiples of {STEP * length:g} m, each once")
        found[round(place)] = [height / length for height in heights]
    return found, seconds


def score(folder: Path, truth: dict[str, Any], chosen: list[str] | None = None) -> list[tuple[Any, ...]]:
    """Return stratum, region, answered share, error, coverage, score and seconds of each record (chosen) and region."""
    files = {path.stem: path for path in sorted(folder.glob("*.csv")) if path.name != SWEEPS}
    if not files:
        raise AnswerError(f"{folder} has no answers: give a folder with files like {min(truth)}.csv")
    if unknown := sorted(set(files) - set(truth)):
        raise AnswerError(f"{files[unknown[0]]}: no record has this number: they are {min(truth)} to {max(truth)}")
    rows = []
    for number in truth if chosen is None else chosen:
        true = truth[number]
        answers, seconds = bands_of(files[number], true["length"]) if number in files else ({}, np.nan)
        y = np.array(true["height"]) / true["length"]
        grid = range(true["first"], true["first"] + y.size)
        # What is not answered has the interval that every rod implies: from its pivot to its length above it.
        lower, middle, upper = np.array([answers.get(k, [0.0, 0.5, 1.0]) for k in grid]).T
        answered, touched = np.array([k in answers for k in grid]), np.array([*true["touched"]]) == "1"
        error, points = np.abs(middle - y), interval_score(y, lower, upper)
        for region, its in zip(REGIONS, (~touched, touched), strict=True):
            if its.any():
                inside = ((lower <= y) & (y <= upper))[its & answered]
                held = inside.mean() if inside.size else np.nan
                numbers = (answered[its].mean(), error[its].mean(), held, points[its].mean(), seconds)
                rows.append((true["stratum"], region, *numbers))
    return rows


def table(rows: list[tuple[Any, ...]]) -> str:
    """Return the table in Markdown by stratum and region, with lengths in thousandths of the rod's."""
    lines = ["| stratum | region | records | answered | error | coverage | score | median score | seconds |"]
    lines += ["|---|---|" + "---:|" * 7]
    for stratum in [*dict.fromkeys(row[0] for row in sorted(rows)), "all"]:
        for region in REGIONS:
            its = [row[2:] for row in rows if stratum in (row[0], "all") and row[1] == region]
            if its:
                answered, error, held, points, seconds = np.array(its, dtype=float).T
                held, seconds = held[np.isfinite(held)], seconds[np.isfinite(seconds)]
                spread = f" ± {100.0 * held.std(ddof=1) / np.sqrt(held.size):.0f}" if held.size > 1 else ""
                cells = [stratum, region, f"{len(its)}", f"{100.0 * answered.mean():.0f} %"]
                cells += [f"{1e3 * np.median(error):.2f}", f"{100.0 * held.mean():.0f}{spread} %" if held.size else "–"]
                cells += [f"{1e3 * points.mean():.2f}", f"{1e3 * np.median(points):.2f}"]
                lines.append(f"| {' | '.join(cells)} | {f'{np.median(seconds):.2g}' if seconds.size else '–'} |")
    return "\n".join(lines)


def score_sweeps(path: Path, known: list[dict[str, str]]) -> str:
    """Return the scores of radii of real objects, in metres."""
    radii = {row["sweep"]: float(row["radius_m"]) for row in known if row["radius_m"]}
    answers, _ = read_answer(path, ("sweep", *COLUMNS[1:]))
    if unknown := sorted(set(answers) - set(radii)):
        raise AnswerError(f"{path}: no radius is known of {unknown[0]}: they are {', '.join(radii)}")
    lower, middle, upper = np.array([*answers.values()]).reshape(-1, 3).T
    y = np.array([radii[sweep] for sweep in answers])
    hold = int(np.sum((lower <= y) & (y <= upper)))
    error, points = 1e3 * np.median(np.abs(middle - y)), 1e3 * interval_score(y, lower, upper).mean()
    return f"{y.size} real sweeps: error {error:.2f} mm, {hold} hold, score {points:.2f} mm"


def main(words: list[str]) -> int:
    folders = [Path(word) for word in words if word != "--common"]
    truth = json.loads((HERE / TRUTH).read_text(encoding="utf-8"))
    with open(HERE / SWEEPS, encoding="utf-8", newline="") as file:
        known = [*csv.DictReader(file)]
    common = [number for number in truth if all((folder / f"{number}.csv").exists() for folder in folders)]
    try:
        for folder in folders:
            print(f"{folder}\n\n{table(score(folder, truth, common if '--common' in words else None))}\n")
            if (folder / SWEEPS).exists():
                print(f"{score_sweeps(folder / SWEEPS, known)}\n")
    except AnswerError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
