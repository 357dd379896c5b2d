"""Prints the cost of each unknown of a rig: widths of bands and standard deviations, to first order.

Profile II of the paper at q = 0.5, swept forward and backward in steps of 2°, with the usual load cell. From Fisher's
information and the priors, as `tb.sensitivity` says them; nothing is drawn.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

import tactile_bayes as tb
from tactile_bayes.planning.information import information
from tactile_bayes.rig.parameters import STANDARD
from tactile_bayes.rig.unknown import DEFAULT, NOTHING, Unknown

CONTOUR = tb.contours.Parabola(a=0.5, q=0.5)
CELL = tb.LoadCell(force_noise=0.05, moment_noise=0.02)
FURTHER = ("drift", "suspension_compliance")
PROBABILITY = 0.9
PARAMETERS = ("a", "q", "x_c")


def sets() -> Iterator[tuple[str, dict[str, Unknown]]]:
    """Return unknowns by name."""
    yield "default", {}
    yield from ((f"without {name}", {name: NOTHING[name]}) for name in STANDARD)
    yield from ((f"with {name}", {name: DEFAULT}) for name in FURTHER)
    yield "gain for rigidity_scale", {"gain": DEFAULT, "rigidity_scale": 1.0}
    yield "none", dict(NOTHING)


def row(unknown: dict[str, Unknown]) -> dict[str, float]:
    """Return widths and standard deviations in thousandths of the rod's length."""
    plan = tb.planning.Plan(
        CONTOUR, tb.Rig(load_cell=CELL, unknown=unknown), drive=tb.Rotation(drive_step=float(np.radians(2.0)))
    )
    told = information(plan, probability=PROBABILITY)
    deviation = told.bound_with_priors.sel(parameter=list(PARAMETERS)).values
    widths = {"gap": float(told.gap_width), "beside": float(told.touched_width)}
    return {name: 1e3 * value for name, value in {**widths, **dict(zip(PARAMETERS, deviation, strict=True))}.items()}


def main() -> None:
    print(f"| inferred | band in the gap | beside it | {' | '.join(f'sd of {name}' for name in PARAMETERS)} |")
    print("|---|" + "---|" * 5)
    for name, unknown in sets():
        print(f"| {name} | " + " | ".join(f"{value:.2f}" for value in row(unknown).values()) + " |")


if __name__ == "__main__":
    main()
