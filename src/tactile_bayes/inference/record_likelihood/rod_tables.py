"""Tables of a rod's pose for the rigs that a likelihood meets."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.elastica import MAX_FRICTION_ANGLE
from tactile_bayes.mechanics.rods.profile import STEEPEST_TAPER, Profile
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.mechanics.rods.surface import Surface

if TYPE_CHECKING:
    from tactile_bayes.mechanics.poses.forward_table import Box, ForwardTable, Tables

# Ranges of tables: distances from the stated taper and rest curvature [1/L], three and four standard deviations of the
# default priors. Few draws are beyond them, and integrated. For thin tips the second range of the taper is taken, and
# for uneven curvature that of the rest curvature.
_TAPERS, _BENDS = (0.15, 0.1), (0.2, 0.15)
_LENGTHS = 0.9, 1.1  # over the stated one, in tables of a cone: ten deviations of the default prior
# Angles of friction in the two tables of a likelihood.
_FRICTION_ANGLES = (0.0, 0.5), (0.5, MAX_FRICTION_ANGLE)
# Share of rods with friction beyond the first table up to which they are integrated: 7 % of draws from the default
# prior.
_FEW = 0.1


class RodTables:
    """Tables of the stated rod, each made for the first rig that needs it, and kept."""

    def __init__(self, rod: Rod, friction: float) -> None:
        self._rod, self._friction = rod, friction
        self.made: dict[tuple[bool, ...], ForwardTable] = {}
        """Tables, or `NO_TABLE` where none is accurate enough, by whether taper, rest curvature, friction and length
        differ from what is stated, and whether friction is strong."""

    def known(self, profile: Profile, taper: Floats, bend: Floats, friction: Floats, length: Floats) -> Tables:
        """Return the tables for rods of a profile; the second is for friction beyond that of the first."""
        from tactile_bayes.mechanics.poses.forward_table import NO_TABLE  # numba takes a second to load

        slides = bool(np.any(friction != self._friction))
        is_cone = self._rod.diameter > 0.0 and bool(np.any(self._rod.taper + taper))
        varied = bool(np.any(taper)), bool(np.any(bend)), slides, is_cone and bool(np.any(length != 1.0))
        share = np.mean(np.arctan(friction) > _FRICTION_ANGLES[0][1])
        is_strong = slides and bool(share > _FEW)
        return self._table(profile, varied, False), self._table(profile, varied, True) if is_strong else NO_TABLE

    def _table(self, profile: Profile, varied: tuple[bool, bool, bool, bool], is_strong: bool) -> ForwardTable:
        from tactile_bayes.mechanics.poses.forward_table import NO_TABLE, forward_table

        key = *varied, is_strong
        if key not in self.made:
            widths = _TAPERS if varied[0] else (0.0,), _BENDS if varied[1] else (0.0,)
            angle = float(np.arctan(self._friction))
            low, high = _FRICTION_ANGLES[is_strong] if varied[2] else (angle, angle)
            for bend, taper in product(*widths[::-1]):
                box = self._box(taper, bend, (low, high), _LENGTHS if varied[3] else (1.0, 1.0))
                self.made[key] = forward_table(profile, box)
                if self.made[key] is not NO_TABLE:
                    break
        return self.made[key]

    def _box(self, width: float, bend: float, friction_angle: tuple[float, float], lengths: tuple[float, float]) -> Box:
        """Return the ranges of a table, for tapers and rest curvatures within distances from the stated ones."""
        from tactile_bayes.mechanics.poses.forward_table import Box

        surface, (low, high) = self._rod.surface, friction_angle
        tapers = max(surface.taper - width, 0.0), min(surface.taper + width, STEEPEST_TAPER)
        cones = zip(tapers, reversed(lengths), strict=True)
        least, most = (Surface(surface.radius / length, taper).half_angle for taper, length in cones)
        return Box(tapers, (-bend, bend), (low - most, high - least))
