"""The verdict: each conclusion where it belongs, and sentences that say one thing."""

import re

import numpy as np
import pytest

from tactile_bayes.calibration.ranks import NoticedRanks
from tactile_bayes.calibration.summary import Tally, conclusion, lost_message, power_message, statement

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
    ("concluded", "tally", "numbers", "named"),
    [
        ("calibrated", Tally(200, lost=1), "200", [": because."]),
        ("not calibrated", Tally(200, lost=9), "200", [": because."]),
        ("undecided", Tally(200, lost=3), "200 3 1%", ["3 were lost", "no other fault"]),
        ("undecided", Tally(200, unconverged=11), "200 11 5%", ["11 did not converge", "no other fault"]),
        ("undecided", Tally(200, 185, 11), "200 185 1% 11 5% 15 20", ["185 were lost", "15 posteriors"]),
        ("too few", Tally(19, lost=4), "15 20", ["15 posteriors"]),
    ],
)
def test_statements(concluded, tally, numbers, named):
    said = statement(concluded, tally, "because")
    assert said.lower().startswith(concluded)
    assert re.findall(r"\d+%?", said) == numbers.split()
    assert all(each in said for each in named)
    assert said.lower().count("calibrated") == ("calibrated" in concluded)  # one conclusion, and no other


def test_lost_ones_in_words():
    one = lost_message({3: "ValueError: a: b"})
    assert all(part in one for part in ("1 lost", ": 3 (ValueError).", "calibration_replicate(3, …)"))
    many = lost_message({n: "ReachError: x" if n % 2 else "KeyError: 'x'" for n in range(4, 10)})
    for part in ("6 lost", ": 4, 5, 6, 7, 8, … (KeyError, ReachError).", "--replicate 4 --debug"):
        assert part in many


def test_power_message():
    value, said = r"\d[\d.]*\d%?", power_message(0.9, 0.7694, 0.9844, NoticedRanks(0.391, 1.433, 1.521))
    assert re.findall(value, said) == ["90%", "76.9%", "98.4%", "90%", "0.39", "1.43", "1.52"]
    assert "at most 76.9% or at least 98.4%" in said
    assert re.search(r"0\.39 standard deviations, .*narrow .* 1\.43, .*wide .* 1\.52\.$", said)
    without = power_message(0.9, 0.43, np.nan, NOTHING)
    assert re.findall(value, without) == ["90%", "43.0%", "90%"]
    assert "at most 43.0%" in without
    shift = power_message(0.9, np.nan, np.nan, NOTHING._replace(shift=1.2))
    assert re.findall(value, shift) == ["90%", "1.2"]
