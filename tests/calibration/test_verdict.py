"""The verdict: each conclusion where it belongs, and sentences that say one thing."""

import numpy as np
import pytest

from tactile_bayes.calibration.ranks import NoticedRanks
from tactile_bayes.calibration.verdict import Tally, conclusion, lost_message, power_message, statement

NOTHING = NoticedRanks(np.nan, np.nan, np.nan)


@pytest.mark.parametrize(
    ("tally", "has_faults", "expected"),
    [
        (Tally(200), False, "calibrated"),
        (Tally(200, lost=2, unconverged=10), False, "calibrated"),
        (Tally(20), False, "calibrated"),
        (Tally(200), True, "not calibrated"),
        (Tally(200, lost=150, unconverged=50), True, "not calibrated"),
        (Tally(200, lost=3), False, "undecided"),
        (Tally(200, unconverged=11), False, "undecided"),
        (Tally(200, lost=3, unconverged=11), False, "undecided"),
        (Tally(20, lost=1), False, "undecided"),
        (Tally(200, lost=200), False, "undecided"),
        (Tally(19), False, "too few"),
        (Tally(19, lost=19), True, "too few"),
    ],
)
def test_conclusions(tally, has_faults, expected):
    assert conclusion(tally, has_faults=has_faults) == expected


@pytest.mark.parametrize(
    ("concluded", "tally", "said"),
    [
        ("calibrated", Tally(200, lost=1), "Calibrated, as far as 200 replicates show: because."),
        ("not calibrated", Tally(200, lost=9), "Not calibrated, over 200 replicates: because."),
        (
            "undecided",
            Tally(200, lost=3),
            "Undecided: of 200 replicates 3 were lost (at most 1% may be); no other fault is found.",
        ),
        (
            "undecided",
            Tally(200, unconverged=11),
            "Undecided: of 200 replicates 11 did not converge (at most 5% may); no other fault is found.",
        ),
        (
            "undecided",
            Tally(200, lost=185, unconverged=11),
            "Undecided: of 200 replicates 185 were lost (at most 1% may be) and "
            "11 did not converge (at most 5% may); 15 posteriors are left, 20 are needed.",
        ),
        ("too few", Tally(19, lost=4), "Too few replicates to judge: 15 posteriors, and at least 20 are needed."),
    ],
)
def test_statements(concluded, tally, said):
    assert statement(concluded, tally, "because") == said
    assert said.lower().count("calibrated") == ("calibrated" in concluded)  # one conclusion, and no other


def test_lost_ones_in_words():
    assert lost_message({3: "ValueError: a: b"}) == (
        "1 lost, in which no claim holds: 3 (ValueError). To see why, add --replicate 3 --debug to the command, or "
        "call calibration_replicate(3, …) with the options of calibrate."
    )
    many = {number: "ReachError: x" if number % 2 else "KeyError: 'x'" for number in range(4, 10)}
    assert lost_message(many).startswith(
        "6 lost, in which no claim holds: 4, 5, 6, 7, 8, … (KeyError, ReachError). To see why, add --replicate 4 "
    )


def test_power_message():
    assert power_message(0.9, 0.7694, 0.9844, NoticedRanks(0.391, 1.433, 1.521)) == (
        "Faults that would have been detected with a probability of 90%: coverage of at most 76.9% or at least 98.4% "
        "in place of 90%, posteriors off by 0.39 standard deviations, too narrow by a factor of 1.43, too wide by a "
        "factor of 1.52."
    )
    without = power_message(0.9, 0.43, np.nan, NOTHING)
    assert without.endswith("90%: coverage of at most 43.0% in place of 90%.")
    assert power_message(0.9, np.nan, np.nan, NOTHING._replace(shift=1.2)).endswith(
        "90%: posteriors off by 1.2 standard deviations."
    )
