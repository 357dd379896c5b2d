"""Default priors of the parameters of contours."""

from __future__ import annotations

from scipy import stats

from tactile_bayes.contours.family import ContourFamily, FamilyParameter
from tactile_bayes.distributions import Distribution

__all__ = ["default_priors", "own_priors"]


def own_priors(family: ContourFamily, length: float) -> dict[str, Distribution]:
    """Return the default priors of a family's parameters, except the vertex, from the rod's length alone.

    Parameters with the same entry of the table share one prior object, so that their densities come from one call.
    """
    entries = {name: entry for name, entry in family.table.items() if entry.prior is not None}
    made = {id(entry): _prior(entry, length) for entry in entries.values()}
    return {name: made[id(entry)] for name, entry in entries.items()}


def _prior(entry: FamilyParameter, length: float) -> Distribution:
    assert entry.prior is not None
    numbers = dict(entry.prior.numbers)
    if entry.length_power:
        numbers["scale"] = numbers["scale"] * length if entry.length_power > 0 else numbers["scale"] / length
    prior: Distribution = getattr(stats, entry.prior.distribution)(**numbers)
    return prior


def default_priors(family: ContourFamily, base: tuple[float, float], length: float) -> dict[str, Distribution]:
    """Return the default priors of a family's parameters by name, from pivot (x, y) and rod length alone [length].

    The vertex is uniformly distributed within a rod length of the pivot, sideways and in height.
    """
    x, y = base
    vertex = {"q": stats.uniform(y - length, 2.0 * length), "x_c": stats.uniform(x - length, 2.0 * length)}
    return own_priors(family, length) | {name: prior for name, prior in vertex.items() if name in family.parameters}
