"""Units of the quantities of a record, and their conversion."""

from __future__ import annotations

import functools
import math
import re
import unicodedata
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from tactile_bayes.record.spelling import plain

Dimension = tuple[int, ...]  # powers of length, force, time and angle
_POWERS = {
    "": 0,
    "da": 1,
    "h": 2,
    "k": 3,
    "M": 6,
    "G": 9,
    "d": -1,
    "c": -2,
    "m": -3,
    "u": -6,
    "μ": -6,
    "n": -9,
    "p": -12,
}
_PREFIXES = {prefix: Fraction(10) ** power for prefix, power in _POWERS.items()}
_DEGREE = Fraction(math.pi) / 180
_BASES: dict[str, tuple[Dimension, Fraction]] = {
    "m": ((1, 0, 0, 0), Fraction(1)),
    "N": ((0, 1, 0, 0), Fraction(1)),
    "gf": ((0, 1, 0, 0), Fraction(980665, 10**8)),
    "Pa": ((-2, 1, 0, 0), Fraction(1)),
    "s": ((0, 0, 1, 0), Fraction(1)),
    "rad": ((0, 0, 0, 1), Fraction(1)),
    **dict.fromkeys(("deg", "°"), ((0, 0, 0, 1), _DEGREE)),
}
_WORDS = {
    **dict.fromkeys(("", "-"), "1"),
    **dict.fromkeys(("deg.", "degree", "degrees"), "deg"),
    **dict.fromkeys(("radian", "radians"), "rad"),
    **dict.fromkeys(("metre", "meter"), "m"),
    "newton": "N",
}
_COMMON: dict[Dimension, tuple[str, ...]] = {
    (1, 0, 0, 0): ("m", "cm", "mm", "µm"),
    (0, 1, 0, 0): ("N", "kN", "mN", "µN", "gf"),
    (1, 1, 0, 0): ("N m", "N mm", "mN m", "µN m", "mN mm"),
    (2, 1, 0, 0): ("N m²", "N cm²", "N mm²", "mN mm²"),
    (-2, 1, 0, 0): ("Pa", "MPa", "GPa", "N/m²", "N/mm²"),
    (-1, 0, 0, 0): ("1/m", "1/cm", "1/mm"),
    (0, 0, 0, 1): ("rad", "mrad", "deg", "°"),
}
_LONGEST, _LARGEST = 100, 10**100  # largest number of characters of a unit, and its largest size in SI
# Units that are often stated with a column, and are none of its quantity, or not known here.
OTHER_UNITS = {
    *("kg", "mg", "lb", "lbs", "lbf", "kgf", "kp", "oz", "ozf", "dyn", "dyne", "inch", "inches", "ft"),
    *("mV", "µV", "kV", "mA", "Pa", "kPa", "MPa", "hPa", "bar", "mbar", "psi", "°C", "°F", "Hz", "kHz"),
    *("count", "counts", "digits", "LSB", "turns", "rev", "%", "gon", "grad"),
}
_SYMBOL = re.compile(
    rf"(?P<prefix>{'|'.join(sorted(_PREFIXES, key=len, reverse=True))})"
    rf"(?P<base>{'|'.join(sorted(_BASES, key=len, reverse=True))})"
    r"(?:\^?(?P<power>-?[1-9]))?"
)
_SEPARATOR = re.compile(r"[\s·⋅•*.]+|-(?=[^\W\d])")


@dataclass(frozen=True)
class Unit:
    """A unit: its size in SI units, and its dimension, powers of length, force, time and angle."""

    scale: Fraction
    dimension: Dimension

    @property
    def is_number(self) -> bool:
        """True for the unit of pure numbers."""
        return not any(self.dimension)


@functools.cache
def unit_of(text: str) -> Unit | None:
    """Parse a unit, or return None. N m², N·m^2, N*m2, N-m² and Nm² are the same one; without a separator a prefix has
    precedence over a product: mN is a millinewton, and m N a newton metre.
    """
    if len(text) > _LONGEST:
        return None
    text = unicodedata.normalize("NFKC", plain(text)).strip()
    text = _WORDS.get(text.lower(), text)
    scale = Fraction(1)
    dimension: Dimension = (0, 0, 0, 0)
    for index, part in enumerate(text.split("/")):
        sense = -1 if index else 1
        for piece in _SEPARATOR.split(part.strip()):
            factors = _factors(piece) if piece != "1" else ()
            if factors is None:
                return None
            for factor in factors:
                scale *= factor.scale**sense
                dimension = tuple(a + sense * b for a, b in zip(dimension, factor.dimension, strict=True))
    return Unit(scale, dimension) if max(scale, 1 / scale) < _LARGEST else None


def same_quantity(one: str, other: str) -> tuple[Unit, Unit] | None:
    """Return two units if they are known, and of the same quantity."""
    first, second = unit_of(one), unit_of(other)
    return None if first is None or second is None or first.dimension != second.dimension else (first, second)


def units_disagree(one: str, other: str) -> bool:
    """Return whether two texts are not the same unit in other spelling; an unknown unit agrees with itself alone."""
    first, second = unit_of(one), unit_of(other)
    if first is None and second is None:
        return plain(one).split() != plain(other).split()
    return first != second


def _factors(piece: str) -> tuple[Unit, ...] | None:
    """Split a piece without separators into units; None if it is not made of units."""
    factors = []
    while piece:
        match = _SYMBOL.match(piece)
        if match is None:
            return None
        dimension, scale = _BASES[match["base"]]
        if dimension[3] and _PREFIXES[match["prefix"]] > 1:  # Grad is a degree or a gon, and nobody's gigaradian
            return None
        power = int(match["power"] or 1)
        factors.append(Unit((_PREFIXES[match["prefix"]] * scale) ** power, tuple(power * one for one in dimension)))
        piece = piece[match.end() :]
    return tuple(factors) or None


def converted(values: Any, unit: Unit, other: Unit) -> Any:
    """Convert values to another unit of the same quantity, an array in place, with one rounding for a power of ten."""
    ratio = unit.scale / other.scale
    out = values if isinstance(values, np.ndarray) else None
    with np.errstate(over="ignore"):  # infinities are refused later
        if ratio.numerator == 1:
            result = np.divide(values, float(ratio.denominator), out=out)
        else:
            result = np.multiply(values, float(ratio), out=out)
    return result if out is not None else float(result)


def accepted_units(expected: str) -> str:
    """List common units of the quantity of a unit, for messages."""
    unit = unit_of(expected)
    names = _COMMON.get(unit.dimension, (expected,)) if unit else (expected,)
    return " or ".join(filter(None, (", ".join(names[:-1]), names[-1])))
