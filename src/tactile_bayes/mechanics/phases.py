"""Contact phases: codes and names."""

__all__ = ["NONE", "PHASE_NAMES", "TANGENTIAL", "TIP"]

NONE, TIP, TANGENTIAL = 0, 1, 2
"""Codes of the contact phase: no contact, Phase A (the tip touches), Phase B (the rod touches tangentially)."""

PHASE_NAMES = ("none", "tip", "tangential")
"""Names of the contact phases, by code."""
