"""The drawing of a rig: numbers in place of its distributions."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Protocol

from scipy.special import ndtri

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_whole_number
from tactile_bayes.distributions import open_share
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.numerics.random_numbers import Rng, generator
from tactile_bayes.rig.parameters import GROUPS
from tactile_bayes.rig.rig_prior import RigPrior
from tactile_bayes.rig.stated import Stated, within_bounds
from tactile_bayes.rig.unknown import Unknown, of_modes, of_pivots

# Parameters that are not drawn, and what to do.
_PLACES = {
    **dict.fromkeys(GROUPS["discrepancy"], "a discrepancy is a function and no number: leave it out where you draw"),
    **dict.fromkeys(("moment_noise", "force_noise"), "state it in the load cell, and give noise_scale where it varies"),
}


class Described(Protocol):
    """What a `Rig` states."""

    @property
    def rod(self) -> Rod | None: ...
    @property
    def load_cell(self) -> LoadCell | None: ...
    @property
    def calibration(self) -> RigPrior | None: ...
    @property
    def said(self) -> Mapping[str, Unknown]: ...
    def is_named(self, name: str) -> bool: ...


def unknown_of(rig: Described, pivots: int, uncertain: Collection[str] = ()) -> dict[str, Unknown]:
    """Return what is said of every parameter of a rig that its calibration has not found; `uncertain` are biases that
    the load cell draws by its own bias_uncertainty.
    """
    found = () if rig.calibration is None else tuple(rig.calibration.priors)
    said = of_pivots({name: value for name, value in rig.said.items() if name not in found}, pivots)
    said = of_modes(said, rig.rod or Rod())
    refuse_undrawn(said)
    hidden = {name for name in uncertain if not rig.is_named(name)}
    drawn = {*found, *(name for name, value in said.items() if not isinstance(value, float))}
    if drawn.issuperset(GROUPS["gain"]) and not rig.is_named("rigidity_scale"):
        hidden.add("rigidity_scale")  # a stiffer rod and larger gains have the same effect
    return {name: value for name, value in said.items() if name not in hidden}


def refuse_undrawn(said: Mapping[str, Unknown]) -> None:
    """Refuse distributions of parameters that are not drawn."""
    for name, value in said.items():
        if name in _PLACES and not isinstance(value, float):
            raise ParameterError(f"{name} is unknown, and is not drawn: {_PLACES[name]}")


def calibrated_at(found: RigPrior, shares: Floats) -> dict[str, Floats]:
    """Return values of parameters by a calibration, each of shape (n,), from independent shares (n, parameters)."""
    points = found.at(ndtri(open_share(shares)))
    return dict(zip(found.priors, points.T, strict=True))


def drawn_numbers(rig: Described, rng: Rng, pivots: int = 1) -> dict[str, Unknown]:
    """Return numbers of all unknowns of a rig; see `Rig.draw`."""
    check_whole_number("pivots", pivots, 1)
    cell = rig.load_cell or LoadCell()
    uncertain = [name for name, size in zip(GROUPS["bias"], cell.bias_uncertainty, strict=True) if size > 0.0]
    said, stated, random = unknown_of(rig, pivots, uncertain), Stated.of(rig.rod or Rod(), cell), generator(rng)
    numbers: dict[str, Unknown] = {}
    for name, value in said.items():
        if isinstance(value, float):
            numbers[name] = value
        else:
            distribution = stated.default(name) if isinstance(value, str) else value
            numbers[name] = float(within_bounds(name, distribution, random.random(1))[0])
    if rig.calibration is not None:
        found = calibrated_at(rig.calibration, random.random((1, len(rig.calibration.priors))))
        numbers |= {name: float(value[0]) for name, value in found.items()}
    return numbers
