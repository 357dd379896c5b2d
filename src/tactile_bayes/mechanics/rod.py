"""The rod: its length and stiffness, and the units of dimensionless quantities."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_number, check_positive
from tactile_bayes.errors import ParameterError

__all__ = ["LARGEST_STRAIN", "Rod"]

_THICKEST = 1e70
"""Diameter whose fourth power overflows [m]."""

LARGEST_STRAIN = 0.1
"""Bending strain up to which a rod is slender and its bending moment is proportional to its curvature."""


@dataclass(frozen=True)
class Rod:
    """A straight uniform rod.

    Without arguments the rod is dimensionless: lengths are in units of the rod's length L, moments of EI/L,
    forces of EI/L² (equation 11 of Merker et al. 2018, doi 10.1155/2018/1613945).

    Parameters
    ----------
    length : float
        Length L from the pivot to the tip [m].
    flexural_rigidity : float
        Young's modulus times second moment of area, EI [N m²].
    diameter : float
        Diameter of a rod of circular cross-section [m]. The rod touches with its surface, half a diameter beside
        its centreline; 0 (the default) stands for a rod without thickness.
    elastic_strain : float, optional
        Largest bending strain without permanent deformation: about 0.002 for mild steel, 0.005 for spring steel, 0.05
        for nitinol. `scan` warns if a rod with a diameter is bent beyond it. Records do not state it.
    rest_curvature : float
        Curvature of the unloaded rod, a circular arc; > 0 counter-clockwise from base to tip [1/m].

    Raises
    ------
    ParameterError
        If length or flexural rigidity is not positive and finite, the diameter is negative or larger than the length,
        the elastic strain is not positive, or the rest curvature is not finite.

    Examples
    --------
    >>> rod = Rod(length=0.1, flexural_rigidity=1.2e-5)
    >>> rod.moment_unit, rod.force_unit
    (0.00012, 0.0012)
    """

    length: float = 1.0
    flexural_rigidity: float = 1.0
    diameter: float = 0.0
    elastic_strain: float | None = None
    rest_curvature: float = 0.0

    def __post_init__(self) -> None:
        for name, unit in (("length", "m"), ("flexural_rigidity", "N m²")):
            check_positive(f"the rod's {name}", getattr(self, name), f"give a positive number [{unit}]")
        check_number("the rod's diameter", self.diameter, "give zero or a positive number [m]", least=0.0)
        if self.elastic_strain is not None:
            check_positive("the rod's elastic strain", self.elastic_strain, "give a positive number, or none")
        if self.diameter > self.length:
            raise ParameterError(
                f"the rod's diameter is {self.diameter!r} and its length {self.length!r}: a rod is longer than it is "
                "thick, give both in metres"
            )
        check_number("the rod's rest_curvature", self.rest_curvature, "give a number [1/m], 0 if it is straight")
        square = float(self.length) * float(self.length)
        if not (square > 0.0 and 0.0 < float(self.flexural_rigidity) / square < math.inf):
            raise ParameterError(
                f"the rod's length is {self.length!r} and its flexural_rigidity {self.flexural_rigidity!r}, so that "
                "its unit of force EI/L² is beyond what numbers hold: are they in metres and N m²?"
            )

    def __repr__(self) -> str:
        strain = "" if self.elastic_strain is None else f", elastic_strain={self.elastic_strain!r}"
        return (
            f"Rod(length={self.length!r}, flexural_rigidity={self.flexural_rigidity!r}, "
            f"diameter={self.diameter!r}{strain})"
        )

    @classmethod
    def circular(
        cls, length: float, diameter: float, youngs_modulus: float, elastic_strain: float | None = None
    ) -> Rod:
        """Rod of solid circular cross-section: EI = E π d⁴ / 64.

        Parameters
        ----------
        length, diameter : float
            Length and diameter [m].
        youngs_modulus : float
            Young's modulus E [Pa].
        elastic_strain : float, optional
            As in `Rod`.

        Returns
        -------
        Rod

        Raises
        ------
        ParameterError
            As in `Rod`, and if diameter or Young's modulus is not positive.

        Examples
        --------
        >>> wire = Rod.circular(length=0.2, diameter=0.7e-3, youngs_modulus=206e9)
        >>> round(wire.flexural_rigidity, 6)
        0.002428
        """
        for name, value in (("diameter", diameter), ("youngs_modulus", youngs_modulus)):
            check_positive(f"the rod's {name}", value)
        fourth = float(diameter) ** 4 if diameter < _THICKEST else math.inf
        return cls(length, youngs_modulus * math.pi * fourth / 64, diameter, elastic_strain)

    @property
    def is_dimensionless(self) -> bool:
        """True if length and flexural rigidity are both 1."""
        return self.length == 1.0 and self.flexural_rigidity == 1.0

    @property
    def length_unit(self) -> float:
        """Unit of length, L [m]."""
        return self.length

    @property
    def moment_unit(self) -> float:
        """Unit of moment, EI/L [N m]."""
        return self.flexural_rigidity / self.length

    @property
    def force_unit(self) -> float:
        """Unit of force, EI/L² [N]."""
        return self.flexural_rigidity / self.length**2

    @property
    def load_units(self) -> Floats:
        """Units of the loads (holding_moment, force_x, force_y): EI/L [N m] and twice EI/L² [N]."""
        return np.array([self.moment_unit, self.force_unit, self.force_unit])
