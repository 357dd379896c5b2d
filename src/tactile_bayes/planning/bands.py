"""The bands of an error map, and where posteriors are inferred for them."""

from __future__ import annotations

from dataclasses import dataclass

from tactile_bayes.checks import check_probability, check_whole_number
from tactile_bayes.inference.family import Family


@dataclass(frozen=True)
class Bands:
    """Bands of the contours of an error map, expected ones in every cell and those of posteriors in some.

    Parameters
    ----------
    probability : float
        Probability of the bands, in (0, 1).
    family : Family, optional
        As in `Plan`: that of all contours, with priors of its parameters.
    posterior_cells : int
        Number of cells, evenly over the map, in which posteriors are inferred; each takes seconds.
    posterior_replicates : int
        Number of posteriors in such a cell.

    Raises
    ------
    ParameterError
        If a number is impossible.
    """

    probability: float = 0.95
    family: Family | None = None
    posterior_cells: int = 0
    posterior_replicates: int = 2

    def __post_init__(self) -> None:
        object.__setattr__(self, "probability", check_probability("probability", self.probability))
        for name, least in (("posterior_cells", 0), ("posterior_replicates", 1)):
            object.__setattr__(self, name, check_whole_number(name, getattr(self, name), least))
