"""Misfit of a record and its model: possible causes, and what to try."""

from __future__ import annotations

from collections.abc import Collection

from tactile_bayes.inference.parameters.unknowns import belongs
from tactile_bayes.rig.parameters import COMPLIANCES

# Advice if loads contradict one another for any contour: the cause is the rig.
CHECK_RIG = (
    "check the rod (length, flexural rigidity, rest curvature, taper, stem), unit, sign and axes of each load, the "
    "zero of the drive angle and its backlash, the point where the load cell takes its moment, and the friction"
)
# Message of the error for a record without a loaded sample.
NO_LOAD = (
    "no sample carries a load that noise does not explain: was anything touched, and is the load cell's noise in the "
    "record's units?"
)
GAUGE = "gauge"  # name of the family of a gauge, whose contour is known
_OF_ROD = ("rest_curvature", "taper", "stem", "length")
# Unknowns of a rig, or groups of them, that may cause a misfit.
_SUSPECTS = ("friction", "gain", "drift", "lever", "backlash", *COMPLIANCES, "lag", "play", *_OF_ROD)
_SMOOTH = "shape-free"


def is_inferred(suspect: str, unknowns: Collection[str]) -> bool:
    """Return True if an unknown of a rig, or one of its group, is among the inferred ones."""
    return any(belongs(name, what) for name in unknowns for what in (suspect, f"{suspect}_seconds"))


def what_to_try(families: Collection[str], unknowns: Collection[str] = (), *, friction: float = 0.0) -> str:
    """Return sentences on the possible causes of a misfit, family and rig, and on what to try."""
    suspects = (*_SUSPECTS, GAUGE) if GAUGE in families else _SUSPECTS
    left = [name for name in suspects if not is_inferred(name, unknowns)]
    if friction and "friction" in left:
        left.remove("friction")
    instead = " in place of rigidity_scale"  # which measures the same as all gains
    named = [f"{name}{instead}" if name == "gain" and "rigidity_scale" in unknowns else name for name in left]
    more = f', or infer more of the rig ("default" under [unknown] of rig.toml: {", ".join(named)})' if named else ""
    if GAUGE in families:
        return f"It may be the gauge or the rig. Check the size of the gauge and its place from the pivot{more}."
    others = "another family (compare)" if _SMOOTH in families else "another family (--family shape-free, or compare)"
    return f"It may be the family or the rig. Try {others}{more}."
