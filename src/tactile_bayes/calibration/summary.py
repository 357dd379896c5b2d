"""What replicates say together: uniformity of ranks, coverage, how often a check raises alarm; and the verdict."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy import stats
from scipy.special import rel_entr

from tactile_bayes.calibration.experiment import Experiment
from tactile_bayes.calibration.ranks import uniformity_p_value
from tactile_bayes.calibration.replicate import DRAWS, LOG_LIKELIHOOD, Outcome

__all__ = ["CLAIMS", "FALSE_ALARM", "summary"]

Floats = NDArray[np.float64]

FALSE_ALARM = 0.01
"""Probability, at most, that the verdict finds fault with posteriors that are right."""

CLAIMS = {
    "pointwise_in_gap": "band, in the gap",
    "pointwise_beside": "band, beside it",
    "simultaneous_in_gap": "band as a whole, in the gap",
    "simultaneous_beside": "band as a whole, beside it",
    "contact_region": "contact regions",
    "snap_off": "angle of snap-off",
}
"""What is stated with a probability, and is to hold with that."""

_MARGIN = 0.01
"""What quantiles of some hundred draws may miss of a probability."""

_FEWEST = 20
"""Replicates below which nothing is said of uniformity or coverage."""

_MOST_FAILED = 0.01


class _Fault(NamedTuple):
    """Something that is not as it is to be, in words."""

    p_value: float
    words: str


def summary(experiment: Experiment, outcomes: Mapping[int, Outcome]) -> xr.Dataset:
    """The Dataset of a calibration; see `calibrate`."""
    numbers = sorted(outcomes)
    rows = [outcomes[number] for number in numbers]
    names = list(dict.fromkeys(name for row in rows for name in row.ranks))
    ranks = np.array([[row.ranks.get(name, -1) for name in names] for row in rows], dtype=int).reshape(len(rows), -1)
    p_values = [_uniformity(of_name) for of_name in ranks.T]
    columns = list(dict.fromkeys(name for row in rows for name in row.numbers))
    values = {name: np.array([row.numbers.get(name, np.nan) for row in rows]) for name in columns}
    found = [name for name in CLAIMS if name in values]
    shares = {name: values[name][np.isfinite(values[name])] for name in found}
    coverage = [float(s.mean()) if s.size else np.nan for s in shares.values()]
    errors = [float(s.std(ddof=1) / np.sqrt(s.size)) if s.size > 1 else np.nan for s in shares.values()]
    data = xr.Dataset(
        {
            "ranks": (("replicate", "quantity"), ranks, {"long_name": f"rank of the truth among {DRAWS} draws"}),
            "rank_p_value": ("quantity", p_values),
            "coverage": ("claim", coverage),
            "coverage_error": ("claim", errors),
            "coverage_replicates": ("claim", [s.size for s in shares.values()]),
            "message": ("replicate", [row.message for row in rows]),
            **{name: ("replicate", of_name) for name, of_name in values.items()},
        },
        coords={"replicate": numbers, "quantity": names, "claim": found},
    )
    failed = Counter(row.message.split(":")[0] for row in rows if not row.ranks)
    with_posterior = sum(1 for row in rows if row.ranks)
    converged = values.get("converged", np.empty(0))
    # Shared by all that is looked at.
    tested = int(np.isfinite(data.rank_p_value).sum()) + int((data.coverage_replicates >= _FEWEST).sum())
    level = FALSE_ALARM / max(tested, 1)
    faults = _faults(data, experiment.probability, level)
    enough = with_posterior >= _FEWEST
    is_calibrated = enough and not faults and sum(failed.values()) <= _MOST_FAILED * len(rows)
    data.attrs = {
        **experiment.words,
        "verdict": _verdict(data, experiment, faults, failed, enough),
        "calibrated": int(is_calibrated),
        "false_alarm": FALSE_ALARM,
        "level": level,
        "replicates": len(rows),
        "without_posterior": sum(failed.values()),
        "not_converged": int(np.sum(converged == 0.0)),
        "probability": experiment.probability,
    }
    return data


def _uniformity(ranks: NDArray[np.intp]) -> float:
    known = ranks[ranks >= 0]
    return uniformity_p_value(known, DRAWS) if known.size >= _FEWEST else np.nan


def _faults(data: xr.Dataset, probability: float, level: float) -> list[_Fault]:
    """What is at most as probable as a level, where posteriors are right."""
    faults = []
    for name, p_value in zip(data.quantity.values, data.rank_p_value.values, strict=True):
        if p_value <= level:
            faults.append(_Fault(float(p_value), f"{name}: {_off(data['ranks'].sel(quantity=name).values, str(name))}"))
    for name in data.claim.values:
        of_claim = data.sel(claim=name)
        if of_claim.coverage_replicates < _FEWEST:
            continue
        held = data[str(name)].values
        p_value = _coverage_p_value(held[np.isfinite(held)], probability)
        if p_value <= level:
            share = float(of_claim.coverage)
            faults.append(_Fault(p_value, f"{CLAIMS[str(name)]}: {share:.0%} hold, not {probability:.0%}"))
    return sorted(faults)


def _coverage_p_value(held: Floats, probability: float) -> float:
    """At most the probability that shares, one for each replicate, have a mean so far from what they are to have.

    Exact where everything holds or not; else by the bound for any numbers between 0 and 1 (Hoeffding 1963, doi
    10.1080/01621459.1963.10500830, theorem 1), as places of one replicate are held together.
    """
    share = float(held.mean())
    limit = float(np.clip(share, probability - _MARGIN, min(probability + _MARGIN, 1.0)))
    if share == limit or not 0.0 < limit < 1.0:
        return 1.0
    if np.isin(held, (0.0, 1.0)).all():
        count = int(held.sum())
        law = stats.binom(held.size, limit)
        one_sided = float(law.sf(count - 1) if share > limit else law.cdf(count))
    else:
        one_sided = float(np.exp(-held.size * (rel_entr(share, limit) + rel_entr(1.0 - share, 1.0 - limit))))
    return min(1.0, 2.0 * one_sided)


def _off(ranks: NDArray[np.intp], name: str) -> str:
    """In which way ranks are not uniform."""
    known = ranks[ranks >= 0] / DRAWS
    shift = (known.mean() - 0.5) * np.sqrt(12.0 * known.size)
    spread = (known.var() - 1.0 / 12.0) * np.sqrt(180.0 * known.size)
    if name == LOG_LIKELIHOOD:
        return "the truth explains the records " + ("better" if shift > 0.0 else "worse") + " than the draws do"
    if abs(shift) > abs(spread):
        return f"posteriors lie too {'low' if shift > 0.0 else 'high'}"
    return f"posteriors are too {'narrow' if spread > 0.0 else 'wide'}"


def _verdict(data: xr.Dataset, experiment: Experiment, faults: list[_Fault], failed: Counter[str], enough: bool) -> str:
    count, probability = data.sizes["replicate"], experiment.probability
    said = []
    if not enough:
        said.append(f"Too few replicates to judge: {count - failed.total()} posteriors, and {_FEWEST} are the least.")
    elif faults:
        said.append(f"Not calibrated, over {count} replicates: " + "; ".join(fault.words for fault in faults) + ".")
    else:
        least = float(np.nanmin(data.rank_p_value))
        said.append(
            f"Calibrated, as far as {count} replicates tell: ranks of the truth are uniform (smallest p of "
            f"{data.sizes['quantity']} quantities {least:.2g}), and what is stated with {probability:.0%} holds as "
            "often."
        )
    held = [
        f"{CLAIMS[str(name)]} {float(data.coverage.sel(claim=name)):.1%} ± "
        f"{float(data.coverage_error.sel(claim=name)):.1%}"
        for name in data.claim.values
        if data.coverage_replicates.sel(claim=name) >= _FEWEST
    ]
    if held:
        said.append(f"Of those with {probability:.0%} hold: {', '.join(held)}.")
    if "check_passed" in data:
        passed = data.check_passed.values[np.isfinite(data.check_passed.values)]
        said.append(f"The check of the record raises alarm in {np.mean(passed == 0.0):.1%} of {passed.size}.")
    unconverged = int(np.sum(data.converged.values == 0.0)) if "converged" in data else 0
    if unconverged:
        said.append(f"{unconverged} did not converge, and are counted like all others.")
    if failed:
        said.append(f"{failed.total()} had no posterior ({', '.join(failed)}), and are not counted.")
    if enough and not faults and failed.total() > _MOST_FAILED * count:
        said.append("These are too many to call it calibrated.")
    return " ".join(said)
