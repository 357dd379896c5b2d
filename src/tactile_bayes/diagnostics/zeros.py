"""Findings on the zeros of a load cell, which records and results have in common."""

from __future__ import annotations

import math
from collections.abc import Container, Mapping

from tactile_bayes.diagnostics.findings import Finding, quantity
from tactile_bayes.record.rig_entry import rig_entry

NOISE_FACTOR = 2.0  # ratio of found to stated noise beyond which it is reported: data sheets are no more accurate
OFF_ZERO = 5.0  # standard errors by which a zero must differ from the stated one to be reported


def moved_zero(p_values: Mapping[str, float], false_alarm: float, known: Container[str] = ()) -> list[Finding]:
    """Report channels whose zero moved between unloaded stretches, except those of which that is known."""
    level = false_alarm / max(sum(map(math.isfinite, p_values.values())), 1)
    moved = [
        f"{name} (p = {p_value:.1g} if it had not)"
        for name, p_value in p_values.items()
        if p_value < level and name not in known
    ]
    return [Finding("zero moved", moved=", ".join(moved), entry=rig_entry("drift", "default", "unknown"))] * bool(moved)


def zero_off(zeros: Mapping[str, tuple[float, float, str]], advice: str) -> list[Finding]:
    """Report channels whose zero is off what is expected: by how much, its standard error, and its unit."""
    off = [
        f"{name} is off by {quantity(away, unit)} ({abs(away) / error:.0f} standard errors)"
        for name, (away, error, unit) in zeros.items()
        if abs(away) > OFF_ZERO * error > 0.0
    ]
    return [Finding("zero off", off=", ".join(off), advice=advice)] * bool(off)
