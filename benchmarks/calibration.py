"""Prints the calibration at the defaults of `infer`: coverage, ranks of the truth, and lost replicates.

Truths are drawn from the default priors of a family and of the unknowns of the rig, at the usual noise, a tenth of
it and three times as much; see `tactile_bayes.calibrate`. Results are kept in results/calibration, so that a run that
was stopped goes on; a number stands for that of replicates. "published" prints the tables of the replicates in
benchmarks/replicates and makes none; "publish" writes those there that were made.

By name, all as "sticking", and at the usual noise only, there are also drives on which a rod may stick: "stage" and
"stage-both", an upright whisker that is carried past one way, or both, and "turned", a rotation that turns back in
contact. In "stage-0.3" and the like the true coefficient of friction is this one, and inference has its default prior.
"published traced" prints the table of `benchmarks.traced`.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

import tactile_bayes as tb
from tactile_bayes.calibration.calibrate import experiment_of
from tactile_bayes.calibration.replicate import Outcome
from tactile_bayes.calibration.summary import CLAIMS, summary
from tactile_bayes.tasks import write_atomically

OUT, PUBLISHED = Path("results/calibration"), Path(__file__).parent / "replicates"
NUMBERS = (*CLAIMS, "converged", "check_passed")  # that the tables need, beside the ranks
SEED = 2026


class Family(NamedTuple):
    title: str
    replicates: int  # number at the usual noise; half as many at others
    drive: tuple[tb.Translation | tb.Motion, ...] | None = None
    friction: float | None = None  # coefficient of friction in truth, if it is not drawn


FAMILIES = {
    "parabola": Family("parabolas", 1000),
    "circle": Family("circles", 500),
    "ellipse": Family("ellipses", 500),
    "power-law": Family("power laws", 500),
    "parabola/power-law": Family("parabola/power-law", 200),
    "shape-free": Family("shape-free", 100),
}
FORTH = tb.Translation((0.75, 0.0), np.pi, 0.5 * np.pi, 1.5)
BACK = tb.Translation((-0.75, 0.0), 0.0, 0.5 * np.pi, 1.5)
# Parabolas, past which the drive goes in another way.
STICKING = {
    "stage": Family("upright, one way", 100, (FORTH,)),
    "stage-0": Family("upright, one way, no friction", 200, (FORTH,), 0.0),
    "stage-0.3": Family("upright, one way, μ = 0.3", 200, (FORTH,), 0.3),
    "stage-both": Family("upright, both ways", 100, (FORTH, BACK)),
    "stage-both-0": Family("upright, both ways, no friction", 200, (FORTH, BACK), 0.0),
    "stage-both-0.3": Family("upright, both ways, μ = 0.3", 200, (FORTH, BACK), 0.3),
    "turned": Family("rotations that turn back", 200, (tb.Motion(0.0, 0.0, np.radians([-30.0, 100.0, 60.0, 210.0])),)),
}
TRACED = {"traced": Family("traced rods", 200)}  # each swept with a rod of its own, by `benchmarks.traced`
EVERY = {**FAMILIES, **STICKING, **TRACED}
NOISES = {"usual": "at the usual noise", "tenth": "at a tenth of the noise", "threefold": "at three times the noise"}
# Standard deviations of forces [EI/L²] and of the moment [EI/L].
_DEVIATIONS = {"usual": (0.05, 0.02), "tenth": (0.005, 0.002), "threefold": (0.15, 0.06)}


def folder_of(family: str, noise: str) -> str:
    return f"{family.replace('/', '-')}-{noise}"


def load_cell(noise: str) -> tb.LoadCell:
    force, moment = _DEVIATIONS[noise]
    return tb.LoadCell(force_noise=force, moment_noise=moment)


def conditions(family: str, noise: str) -> dict[str, Any]:
    """Arguments of `calibrate` and `experiment_of`."""
    one, name = EVERY[family], family if family in FAMILIES else "parabola"
    found = {"rig": tb.Rig(load_cell=load_cell(noise)), "rng": SEED, "family": name}
    if one.drive is not None:
        found["drive"] = one.drive
    if one.friction is not None:
        found["truth"] = tb.Rig(unknown={"friction": one.friction})
    return found


def published(families: Iterable[str], noise: str) -> dict[str, xr.Dataset]:
    """Return the calibrations whose replicates are published, by family."""
    return {
        family: judged(family, noise, map(_outcome, _rows(family, noise)))
        for family in families
        if _path(family, noise).exists()
    }


def judged(family: str, noise: str, outcomes: Iterable[Outcome]) -> xr.Dataset:
    experiment = experiment_of(**conditions(family, noise))
    return summary(experiment.identity, experiment.probability, dict(enumerate(outcomes)))


def _path(family: str, noise: str) -> Path:
    return PUBLISHED / f"{folder_of(family, noise)}.csv"


def _rows(family: str, noise: str) -> list[dict[str, str]]:
    with _path(family, noise).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def _outcome(row: dict[str, str]) -> Outcome:
    known = {name: float(text) for name, text in row.items() if text}
    numbers = {name: known.pop(name) for name in NUMBERS if name in known}
    return Outcome({name: int(rank) for name, rank in known.items()}, numbers, "")


def pooled(family: str, noise: str, each: Iterable[xr.Dataset]) -> xr.Dataset:
    """Return one calibration of replicates that were made one by one, each with a rig of its own."""
    outcomes = []
    for one in (several.isel(replicate=0) for several in each):
        ranks = {str(name): int(rank) for name, rank in zip(one.quantity.values, one["ranks"].values, strict=True)}
        numbers = {name: float(one[name]) for name in NUMBERS if name in one}
        outcomes.append(Outcome(ranks, numbers, str(one.message.values)))
    return judged(family, noise, outcomes)


def publish(family: str, noise: str, made: xr.Dataset) -> None:
    """Write ranks and claims of a calibration, a row for each replicate, in place of one with no more of them."""
    path = _path(family, noise)
    if path.exists() and len(_rows(family, noise)) > made.sizes["replicate"]:
        raise SystemExit(
            f"{path} holds more replicates than the {made.sizes['replicate']} made: remove it to publish these"
        )
    ranks = {str(name): made["ranks"].sel(quantity=name).values for name in made.quantity.values}
    columns = {name: [rank if rank >= 0 else "" for rank in of_one] for name, of_one in ranks.items()}
    for name in NUMBERS:
        if name in made:
            columns[name] = [str(v) if np.isfinite(v) else "" for v in made[name].values.tolist()]
    with write_atomically(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([columns, *zip(*columns.values(), strict=True)])


def table(noise: str, calibrations: dict[str, xr.Dataset]) -> str:
    """Return a table in Markdown with a column for each family."""
    found = list(calibrations.values())

    def row(name: str, cells: Iterable[str]) -> str:
        return f"| {name} | {' | '.join(cells)} |"

    def held(name: str) -> str:
        return row(CLAIMS[name], (_share(one.sel(claim=name)) if name in one.claim else "–" for one in found))

    p_values = [one.rank_p_value.dropna("quantity") for one in found]
    smallest = [f"{float(each.min()):.2g} of {each.size}" if each.size else "–" for each in p_values]
    titles = [f"{one.sizes['replicate']} {EVERY[family].title}" for family, one in calibrations.items()]
    return "\n".join(
        [
            row(NOISES[noise], titles),
            "|" + "---|" * (len(found) + 1),
            *(held(name) for name in CLAIMS),
            row("smallest p-value of the ranks", smallest),
            row("verdict", (one.attrs["conclusion"] for one in found)),
            row("ended in an error", (str(one.attrs["lost"]) for one in found)),
            row("did not converge, and said so", (str(one.attrs["not_converged"]) for one in found)),
            row("false alarms of the check of the record", (str(int((one.check_passed == 0).sum())) for one in found)),
        ]
    )


def _share(claim: xr.Dataset) -> str:
    return f"{100 * float(claim.coverage):.1f} ± {100 * float(claim.coverage_error):.1f} %"


def calibrated(family: str, noise: str, replicates: int | None) -> xr.Dataset:
    replicates = replicates or EVERY[family].replicates // (1 if noise == "usual" else 2)
    found = tb.calibrate(**conditions(family, noise), replicates=replicates, out=OUT / folder_of(family, noise))
    print(f"{family}, {noise} noise: {found.attrs['verdict']}", flush=True)
    return found


def main(*chosen: str) -> None:
    count = next((int(word) for word in chosen if word.isdigit()), None)
    families = list(STICKING) if "sticking" in chosen else [name for name in EVERY if name in chosen] or list(FAMILIES)
    if "traced" in families and "published" not in chosen:
        raise SystemExit("python -m benchmarks.traced records makes the replicates of traced rods")
    noises = ["usual"] if set(families) - set(FAMILIES) else [name for name in NOISES if name in chosen] or list(NOISES)
    for noise in noises:
        if "published" in chosen:
            made = published(families, noise)
            if not made:
                print(f"no replicates of {', '.join(families)} {NOISES[noise]} are published", flush=True)
                continue
        else:
            made = {name: calibrated(name, noise, count) for name in families}
        if "publish" in chosen:
            for name, one in made.items():
                publish(name, noise, one)
        print(f"\n{table(noise, made)}\n", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
