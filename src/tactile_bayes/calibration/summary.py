"""Summary of all replicates: uniformity of ranks, coverage, power, alarms of the record check, and the verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy import stats
from scipy.special import betaincinv, rel_entr

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.calibration.ranks import NoticedRanks, noticed_ranks, uniformity_p_value
from tactile_bayes.calibration.replicate import DRAWS, LOG_LIKELIHOOD, Outcome

_MARGIN = 0.01  # error in probability that is allowed for quantiles of some hundred draws
Conclusion = Literal["calibrated", "not calibrated", "undecided", "too few"]
FEWEST = 20  # least number of replicates for which uniformity and coverage are tested
POWER = 0.9  # probability with which the faults that a verdict names would have been detected
_MOST_LOST = 0.01  # largest share of lost replicates of a calibrated posterior; coverage may be wrong by as much
# Largest share of unconverged runs; beyond it, the limit of steps is tested instead of the posteriors.
_MOST_UNCONVERGED = 0.05
_NAMED = 5  # largest number of lost replicates whose numbers are stated
FALSE_ALARM = 0.01  # largest probability that the verdict finds a fault in right posteriors
# Statements that must hold with the stated probability: names and descriptions.
CLAIMS = {
    "pointwise_in_gap": "band, in the gap",
    "pointwise_beside": "band, beside it",
    "simultaneous_in_gap": "band as a whole, in the gap",
    "simultaneous_beside": "band as a whole, beside it",
    "contact_region": "contact regions",
    "snap_off": "angle of snap-off",
}


def coverage_p_value(share: ArrayLike, count: int, probability: float, *, is_whole: bool) -> Floats:
    """Return an upper bound on the probability that an observed coverage is as far from the stated one by chance."""
    share = np.asarray(share, dtype=float)
    limit = np.clip(share, probability - _MARGIN, min(probability + _MARGIN, 1.0))
    is_tested = (share != limit) & (limit > 0.0) & (limit < 1.0)
    if is_whole:
        held = np.rint(share * count)
        one_sided = np.where(share > limit, stats.binom.sf(held - 1, count, limit), stats.binom.cdf(held, count, limit))
    else:
        one_sided = np.exp(-count * (rel_entr(share, limit) + rel_entr(1.0 - share, 1.0 - limit)))
    return np.where(is_tested, np.minimum(1.0, 2.0 * one_sided), 1.0)


def noticed_coverage(
    count: int, probability: float, level: float, power: float, *, is_whole: bool
) -> tuple[float, float]:
    """Return the coverages nearest to a stated one, below and above, that a test detects with the probability `power`.

    A claim that holds at a share of the grid points is taken to hold at all or none of them, the largest variance.
    """
    held = np.arange(count + 1)
    is_fault = coverage_p_value(held / count, count, probability, is_whole=is_whole) <= level
    low, high = held[is_fault & (held < probability * count)], held[is_fault & (held > probability * count)]
    # With c, P(held ≤ k) = 1 − I_c(k + 1, n − k) and P(held ≥ k) = I_c(k, n − k + 1).
    below = float(betaincinv(low[-1] + 1, count - low[-1], 1.0 - power)) if low.size else np.nan
    above = float(betaincinv(high[0], count - high[0] + 1, power)) if high.size else np.nan
    return below, above


@dataclass(frozen=True)
class Tally:
    """Numbers of replicates: all, lost, and not converged."""

    replicates: int
    lost: int = 0
    unconverged: int = 0

    @property
    def has_few_lost(self) -> bool:
        """True if the share of lost replicates permits a conclusion."""
        return self.lost <= _MOST_LOST * self.replicates

    @property
    def has_few_unconverged(self) -> bool:
        """True if the share of unconverged runs permits a conclusion."""
        return self.unconverged <= _MOST_UNCONVERGED * self.replicates


def conclusion(tally: Tally, *, has_faults: bool) -> Conclusion:
    """Return the conclusion: a fault stands whatever was lost; its absence counts if nearly all were tested."""
    if tally.replicates < FEWEST:
        return "too few"
    if has_faults:
        return "not calibrated"
    return "calibrated" if tally.has_few_lost and tally.has_few_unconverged else "undecided"


def statement(concluded: Conclusion, tally: Tally, reason: str) -> str:
    """Return the sentence of a conclusion, with the reason why posteriors are called calibrated or not."""
    count, left = tally.replicates, tally.replicates - tally.lost
    if concluded == "calibrated":
        return f"Calibrated, as far as {count} replicates show: {reason}."
    if concluded == "not calibrated":
        return f"Not calibrated, over {count} replicates: {reason}."
    if concluded == "too few":
        return f"Too few replicates to judge: {left} posteriors, and at least {FEWEST} are needed."
    too_many = [] if tally.has_few_lost else [f"{tally.lost} were lost (at most {_MOST_LOST:.0%} may be)"]
    if not tally.has_few_unconverged:
        too_many.append(f"{tally.unconverged} did not converge (at most {_MOST_UNCONVERGED:.0%} may)")
    rest = "no other fault is found" if left >= FEWEST else f"{left} posteriors are left, {FEWEST} are needed"
    return f"Undecided: of {count} replicates {' and '.join(too_many)}; {rest}."


def power_message(probability: float, below: float, above: float, ranks: NoticedRanks) -> str:
    """Return the sentence on the faults that would have been detected; NaN stands for none of a kind."""
    bounds = {"at most": below, "at least": above}
    coverages = [f"{bound} {share:.1%}" for bound, share in bounds.items() if np.isfinite(share)]
    faults = [f"coverage of {' or '.join(coverages)} in place of {probability:.0%}"] if coverages else []
    faults += [f"posteriors off by {ranks.shift:.2g} standard deviations"] if np.isfinite(ranks.shift) else []
    widths = {"narrow": ranks.narrow, "wide": ranks.wide}
    faults += [f"too {way} by a factor of {factor:.2f}" for way, factor in widths.items() if np.isfinite(factor)]
    return f"Faults that would have been detected with a probability of {POWER:.0%}: {', '.join(faults)}."


def lost_message(messages: Mapping[int, str]) -> str:
    """Return the sentence on lost replicates, and how to see the reason, from their messages by number."""
    numbers = list(messages)
    first = ", ".join(map(str, numbers[:_NAMED])) + (", …" if len(numbers) > _NAMED else "")
    kinds = ", ".join(dict.fromkeys(message.partition(":")[0] for message in messages.values()))
    return (
        f"{len(numbers)} lost, in which no claim holds: {first} ({kinds}). To see why, add --replicate {numbers[0]} "
        f"--debug to the command, or call calibration_replicate({numbers[0]}, …) with the options of calibrate."
    )


def summary(identity: Mapping[str, str], probability: float, outcomes: Mapping[int, Outcome]) -> xr.Dataset:
    """Return the result of a calibration; see `calibrate`."""
    numbers = sorted(outcomes)
    rows = [outcomes[number] for number in numbers]
    data, level = _tested(rows, probability)
    data = data.assign_coords(replicate=numbers)
    lost = {number: row.message for number, row in zip(numbers, rows, strict=True) if row.is_lost}
    unconverged = int(np.sum(data.converged.values == 0.0)) if "converged" in data else 0
    tally = Tally(len(rows), len(lost), unconverged)
    # If many are lost, the verdict states their share, and faults are sought in the others.
    judged = data if tally.has_few_lost else data.drop_sel(replicate=list(lost))
    faults = _faults(judged, probability, level)
    concluded = conclusion(tally, has_faults=bool(faults))
    left = len(rows) - tally.lost
    ranks_noticed = noticed_ranks(left, DRAWS, level, POWER) if left >= FEWEST else NoticedRanks(*3 * [np.nan])
    data.attrs = {
        **identity,
        "calibrated": int(concluded == "calibrated"),
        "conclusion": concluded,
        "false_alarm": FALSE_ALARM,
        "level": level,
        "power": POWER,
        **{f"noticed_{name}": value for name, value in ranks_noticed._asdict().items()},
        "replicates": tally.replicates,
        "lost": tally.lost,
        "not_converged": tally.unconverged,
        "probability": probability,
    }
    reason = "; ".join(message for _, message in faults)
    if concluded == "calibrated":
        reason = (
            f"ranks of the truth are uniform (smallest p of {data.sizes['quantity']} quantities "
            f"{float(data.rank_p_value.min()):.2g}), and bands and regions of {probability:.0%} hold as often as stated"
        )
    data.attrs["verdict"] = " ".join([statement(concluded, tally, reason), *_further(data, ranks_noticed, lost)])
    return data


def _tested(rows: Sequence[Outcome], probability: float) -> tuple[xr.Dataset, float]:
    """Return ranks, coverages and numbers of replicates, and the level of each test."""
    names = list(dict.fromkeys(name for row in rows for name in row.ranks))
    ranks = np.array([[row.ranks.get(name, -1) for name in names] for row in rows], dtype=int).reshape(len(rows), -1)
    known = [of_name[of_name >= 0] for of_name in ranks.T]
    p_values = [uniformity_p_value(of_name, DRAWS) if of_name.size >= FEWEST else np.nan for of_name in known]
    columns = list(dict.fromkeys(name for row in rows for name in row.numbers))
    values = {name: np.array([row.numbers.get(name, np.nan) for row in rows]) for name in columns}
    found = [name for name in CLAIMS if name in values]
    for name in found:
        values[name][[row.is_lost for row in rows]] = 0.0
    shares = [_known(values[name]) for name in found]
    coverage = [float(s.mean()) if s.size else np.nan for s in shares]
    errors = [float(s.std(ddof=1) / np.sqrt(s.size)) if s.size > 1 else np.nan for s in shares]
    # The false-alarm rate is shared by all tests.
    tested = int(np.isfinite(p_values).sum()) + sum(s.size >= FEWEST for s in shares)
    level = FALSE_ALARM / max(tested, 1)
    none = np.nan, np.nan
    noticed = [
        noticed_coverage(s.size, probability, level, POWER, is_whole=_is_whole(s)) if s.size >= FEWEST else none
        for s in shares
    ]
    data = xr.Dataset(
        {
            "ranks": (("replicate", "quantity"), ranks, {"long_name": f"rank of the truth among {DRAWS} draws"}),
            "rank_p_value": ("quantity", p_values),
            "coverage": ("claim", coverage),
            "coverage_error": ("claim", errors),
            "coverage_replicates": ("claim", [s.size for s in shares]),
            "noticed_below": ("claim", [below for below, _ in noticed]),
            "noticed_above": ("claim", [above for _, above in noticed]),
            "message": ("replicate", [row.message for row in rows]),
            "traceback": ("replicate", [row.traceback for row in rows]),
            **{name: ("replicate", of_name) for name, of_name in values.items()},
        },
        coords={"quantity": names, "claim": found},
    )
    return data, level


def _known(values: Floats) -> Floats:
    return values[np.isfinite(values)]


def _is_whole(shares: Floats) -> bool:
    """Return True if a claim held or failed as a whole in each replicate."""
    return bool(np.isin(shares, (0.0, 1.0)).all())


def _faults(data: xr.Dataset, probability: float, level: float) -> list[tuple[float, str]]:
    """Return p-values at most a level, with what is at fault, the least probable first."""
    faults = []
    for name, p_value in zip(data.quantity.values, data.rank_p_value.values, strict=True):
        if p_value <= level:
            faults.append((float(p_value), f"{name}: {_off(data['ranks'].sel(quantity=name).values, str(name))}"))
    for name in data.claim.values:
        shares = _known(data[str(name)].values)
        if shares.size < FEWEST:
            continue
        share = float(shares.mean())
        p_value = float(coverage_p_value(share, shares.size, probability, is_whole=_is_whole(shares)))
        if p_value <= level:
            faults.append((p_value, f"{CLAIMS[str(name)]}: {share:.0%} hold, not {probability:.0%}"))
    return sorted(faults)


def _off(ranks: Index, name: str) -> str:
    """Describe how ranks deviate from uniform ones."""
    known = ranks[ranks >= 0] / DRAWS
    shift = (known.mean() - 0.5) * np.sqrt(12.0 * known.size)
    spread = (known.var() - 1.0 / 12.0) * np.sqrt(180.0 * known.size)
    if name == LOG_LIKELIHOOD:
        return "the truth explains the records " + ("better" if shift > 0.0 else "worse") + " than the draws do"
    if abs(shift) > abs(spread):
        return f"posteriors lie too {'low' if shift > 0.0 else 'high'}"
    return f"posteriors are too {'narrow' if spread > 0.0 else 'wide'}"


def _further(data: xr.Dataset, ranks_noticed: NoticedRanks, lost: Mapping[int, str]) -> list[str]:
    """Return the further sentences of a verdict: coverage, power, record check, unconverged and lost replicates."""
    sentences, probability = [], data.attrs["probability"]
    judged = data.sel(claim=data.coverage_replicates >= FEWEST)
    below = above = np.nan
    if judged.sizes["claim"]:
        shares = zip(judged.claim.values, judged.coverage.values, judged.coverage_error.values, strict=True)
        held = [f"{CLAIMS[str(name)]} {share:.1%} ± {error:.1%}" for name, share, error in shares]
        sentences.append(f"Coverage at {probability:.0%}: {', '.join(held)}.")
        # The claim with the least power counts; NaN if one has none.
        below, above = float(np.min(judged.noticed_below.values)), float(np.max(judged.noticed_above.values))
    if np.isfinite([below, *ranks_noticed]).any():
        sentences.append(power_message(probability, below, above, ranks_noticed))
    if "check_passed" in data:
        passed = _known(data.check_passed.values)
        sentences.append(f"The check of the record raises an alarm in {np.mean(passed == 0.0):.1%} of {passed.size}.")
    if data.attrs["not_converged"]:
        sentences.append(f"{data.attrs['not_converged']} did not converge, and are included.")
    if lost:
        sentences.append(lost_message(lost))
    return sentences
