"""The verdict of a calibration: its conclusion, and sentences on power and on lost replicates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from tactile_bayes.calibration.ranks import NoticedRanks

Conclusion = Literal["calibrated", "not calibrated", "undecided", "too few"]

FEWEST = 20  # least number of replicates for which uniformity and coverage are tested
POWER = 0.9  # probability with which the faults that a verdict names would have been detected
_MOST_LOST = 0.01  # largest share of lost replicates of a calibrated posterior; coverage may be wrong by as much
# Largest share of unconverged runs; beyond it, the limit of steps is tested instead of the posteriors.
_MOST_UNCONVERGED = 0.05
_NAMED = 5  # largest number of lost replicates whose numbers are stated


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
