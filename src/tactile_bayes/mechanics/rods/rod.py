"""The rod: its length and stiffness, and the units of dimensionless quantities."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_array, check_number, check_numbers, check_positive, refused
from tactile_bayes.errors import ParameterError
from tactile_bayes.mechanics.rods.along import MISS, Along, along, modes_along
from tactile_bayes.mechanics.rods.profile import MOST_MODES, STEEPEST_TAPER, Profile, Rods, profile_of
from tactile_bayes.mechanics.rods.surface import Surface
from tactile_bayes.numerics import chebyshev

_THICKEST = 1e70  # diameter whose fourth power overflows [m]
# Turn between base and tip [rad] up to which every point of an arc is farther from the base than those before it.
_MOST_TURN = math.pi
_POINTS = 2001  # points of a rod at rest
# Error of a traced rest curvature over its standard deviation, and of modes over their size, that is negligible.
_NEGLIGIBLE = 1e-2
# Bending strain up to which a rod is slender and its bending moment is proportional to its curvature.
LARGEST_STRAIN = 0.1


@dataclass(frozen=True)
class Rod:
    """A rod, straight, curved or tapered.

    Without arguments the rod is dimensionless: lengths are in units of the rod's length L, moments of EI/L,
    forces of EI/L² (equation 11 of Merker et al. 2018, doi 10.1155/2018/1613945).

    Parameters
    ----------
    length : float
        Length L from the pivot to the tip [m].
    flexural_rigidity : float
        Young's modulus times second moment of area, EI, at the base [N m²].
    diameter : float
        Diameter of a rod of circular cross-section [m], at the base if it is tapered. The rod touches with its surface,
        half a diameter beside its centreline; 0 (the default) stands for a rod without thickness.
    elastic_strain : float, optional
        Largest bending strain without permanent deformation: about 0.002 for mild steel, 0.005 for spring steel, 0.05
        for nitinol. `scan` warns if a rod with a diameter is bent beyond it. Records do not state it.
    rest_curvature : float, callable or (s, curvature)
        Curvature of the unloaded rod [1/m]: a number for a circular arc, a function of the arc length s from the base
        [m] that works on arrays, or arrays of both. A positive one bends counter-clockwise from base to tip; the drive
        angle is the direction at the base.
    taper : float
        The diameter falls linearly to (1 − taper) of that at the base, and the flexural rigidity with its fourth power.
    rigidity_profile : callable or (s, EI/EI0), optional
        Flexural rigidity along the rod over that at the base, as a function or arrays like the rest curvature; by
        default constant. A taper comes on top of it, and alone changes the diameter.
    rest_curvature_deviation : float
        Standard deviation of the mean rest curvature [1/m], if it was measured (`from_shape`): that of the unknown
        `rest_curvature` in its default prior.
    stem : float
        Length of a rigid, straight piece between the pivot and the rod, in the direction of its base [m], as of a
        clamp that sits on a hinge; at most that of the rod. Drive angle, moment and forces are those at the pivot, and
        a compliant suspension yields there; arc lengths begin where the rod does. Contact is with the rod alone.
    rest_shape_modes : sequence of callable or (s, curvature)
        What is uncertain of the course of the rest curvature, if it was measured (`from_shape`): at most three
        independent deviations from it, each as large as its standard deviation [1/m]. Their amplitudes are the unknowns
        `rest_shape_1` to `rest_shape_5` of a rig.
    taper_deviation : float
        Standard deviation of the taper, if it was measured (`from_shape`): that of the unknown `taper` in its default
        prior. In these deviations `taper_error` is unknown.

    Raises
    ------
    ParameterError
        If length or flexural rigidity is not positive and finite, the diameter is negative or larger than the length,
        the elastic strain is not positive, a taper is not from 0 to 0.95, a stem negative or longer than the rod, a
        property along the rod is invalid, or the rod at rest curls back toward its pivot, as an arc of more than a half
        circle does.

    Examples
    --------
    >>> rod = Rod(length=0.1, flexural_rigidity=1.2e-5)
    >>> rod.moment_unit, rod.force_unit
    (0.00012, 0.0012)
    >>> Rod(length=0.1, flexural_rigidity=1.2e-5, rest_curvature=4.0)
    Rod(length=0.1, flexural_rigidity=1.2e-05, diameter=0.0, rest_curvature=4.0)
    >>> Rod(taper=0.5, rest_curvature=lambda s: 0.4 * s)
    Rod(length=1.0, flexural_rigidity=1.0, diameter=0.0, rest_curvature=Along(from 0 to 0.4, 1 cells), taper=0.5)
    """

    length: float = 1.0
    flexural_rigidity: float = 1.0
    diameter: float = 0.0
    elastic_strain: float | None = None
    rest_curvature: Any = 0.0
    taper: float = 0.0
    rigidity_profile: Any = None
    rest_curvature_deviation: float = 0.0
    stem: float = 0.0
    rest_shape_modes: Any = ()
    taper_deviation: float = 0.0

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
        correction = f"give a number from 0, for none, to {STEEPEST_TAPER}"
        check_number("the rod's taper", self.taper, correction, least=0.0, most=STEEPEST_TAPER)
        correction = "give zero, for one that was not measured, or a positive number"
        check_number("the rod's taper_deviation", self.taper_deviation, correction, least=0.0)
        if self.rigidity_profile is not None:
            of_rod = along("the rod's rigidity_profile", self.rigidity_profile, self.length, positive=True)
            uniform = isinstance(of_rod, float) and of_rod == 1.0
            object.__setattr__(self, "rigidity_profile", None if uniform else of_rod)
        object.__setattr__(self, "rest_curvature", along("the rod's rest_curvature", self.rest_curvature, self.length))
        modes = modes_along("the rod's rest_shape_modes", self.rest_shape_modes, self.length, MOST_MODES)
        object.__setattr__(self, "rest_shape_modes", modes)
        correction = "give zero, for an unknown one, or a positive number [1/m]"
        check_number("the rod's rest_curvature_deviation", self.rest_curvature_deviation, correction, least=0.0)
        correction = f"give a length [m] from 0, for none, to that of the rod, {self.length:g}"
        check_number("the rod's stem", self.stem, correction, least=0.0, most=self.length)
        for name in ("taper", "taper_deviation", "stem", "rest_curvature_deviation"):
            object.__setattr__(self, name, float(getattr(self, name)))  # a number of NumPy's compares as an array
        self._refuse_curl()
        square = float(self.length) * float(self.length)
        if not (square > 0.0 and 0.0 < float(self.flexural_rigidity) / square < math.inf):
            raise ParameterError(
                f"the rod's length is {self.length!r} and its flexural_rigidity {self.flexural_rigidity!r}, so that "
                "its unit of force EI/L² is beyond what numbers hold: are they in metres and N m²?"
            )

    def _refuse_curl(self) -> None:
        """Refuse a rod that is not, all along, farther from its base than before."""
        if isinstance(self.rest_curvature, float):
            most = _MOST_TURN / self.length
            correction = f"give a number [1/m] between ±{most:.4g}, where the rod is a half circle; 0 if it is straight"
            check_number("the rod's rest_curvature", self.rest_curvature, correction, least=-most, most=most)
            if self.stem == 0.0:
                return
        from scipy.integrate import cumulative_simpson  # takes a while to load

        s = np.linspace(0.0, self.length, _POINTS)
        bent = self.rest_curvature(s) if isinstance(self.rest_curvature, Along) else self.rest_curvature + 0.0 * s
        slope = cumulative_simpson(bent, x=s, initial=0.0)
        x, y = (cumulative_simpson(way, x=s, initial=0.0) for way in (np.cos(slope), np.sin(slope)))
        outward = (self.stem + x) * np.cos(slope) + y * np.sin(slope)
        if np.any(outward[1:] <= 0.0):
            at = s[1:][outward[1:] <= 0.0][0]
            raise ParameterError(
                f"the rod's rest_curvature lets it curl back toward its {'pivot' if self.stem else 'base'} from s = "
                f"{at:.4g} on, and it is {self.length:.4g} long: give a curvature with which it leads away all along"
            )

    def __repr__(self) -> str:
        shown = [(name, getattr(self, name)) for name in ("length", "flexural_rigidity", "diameter")]
        shown += [(f.name, of) for f in fields(self)[3:] if (of := getattr(self, f.name)) != f.default]
        return f"Rod({', '.join(f'{name}={value!r}' for name, value in shown)})"

    @classmethod
    def circular(
        cls,
        length: float,
        diameter: float,
        youngs_modulus: float,
        elastic_strain: float | None = None,
        rest_curvature: Any = 0.0,
        taper: float = 0.0,
    ) -> Rod:
        """Rod of solid circular cross-section: EI = E π d⁴ / 64.

        Parameters
        ----------
        length, diameter : float
            Length, and diameter at the base [m].
        youngs_modulus : float
            Young's modulus E [Pa].
        elastic_strain, rest_curvature, taper
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
        rigidity = round_rigidity(diameter, youngs_modulus)
        return cls(length, rigidity, diameter, elastic_strain, rest_curvature, taper)

    @classmethod
    def from_shape(
        cls,
        x: ArrayLike,
        y: ArrayLike,
        flexural_rigidity: float | None = None,
        *,
        scatter: float | None = None,
        length: float | None = None,
        diameter: ArrayLike = 0.0,
        taper: float = 0.0,
        rigidity_profile: Any = None,
        stem: float = 0.0,
    ) -> Rod:
        """Rod whose rest curvature follows from points traced along it while nothing touches it.

        The rest curvature is the posterior mean for a smooth random function of the arc length, integrated white noise;
        how smooth it is follows from the points (`traced`). What they leave open are its modes, the principal
        components of the deflections that it causes. It is interpolated with an error of a hundredth of its standard
        deviation.

        Parameters
        ----------
        x, y : array_like, shape (n,)
            Points in order, from the base to the tip, at least 8 [m]. Where they lie, and how they are turned, does not
            matter, but the image must not be mirrored: y is to the left of x.
        flexural_rigidity : float, optional
            EI at the base [N m²]. By default the rod is dimensionless, and the points are in any unit of length.
        scatter : float, optional
            Standard deviation of each coordinate, in the unit of the points; estimated from them by default.
        length : float, optional
            Length of the rod from the first point on, in the unit of the points, if it continues beyond the last one,
            like a whisker whose tip must not be touched. The rest curvature there continues with its trend. By default
            the last point is the tip.
        diameter : float or array_like, shape (n,)
            As in `Rod`, in the unit of the points, or measured at each of them: then diameter at the base and taper,
            with its standard deviation, follow.
        stem : float
            As in `Rod`, in the unit of the points.
        taper, rigidity_profile
            As in `Rod`.

        Returns
        -------
        Rod
            With `rest_curvature_deviation`, `rest_shape_modes` and, from diameters at the points, `taper_deviation`.

        Raises
        ------
        ParameterError
            As in `Rod`, and if the points are not those of a rod: too few, not in order, turned back, or scattered by
            more than a twentieth of the length; if diameters do not fall linearly, or a taper is given beside them.

        Examples
        --------
        >>> angle = np.linspace(0.0, 0.6, 30)
        >>> whisker = Rod.from_shape(0.05 * np.sin(angle), 0.05 * (1.0 - np.cos(angle)), flexural_rigidity=1e-8)
        >>> round(whisker.length, 6), round(whisker.mean_rest_curvature, 3)
        (0.03, 20.0)
        """
        from tactile_bayes.mechanics.rods.traced import MeasuredCone, measured_cone, traced_rod

        correction = "give zero or positive numbers, one or one for each point, in the unit of the points"
        diameters = check_numbers("diameter", diameter, correction, least=0.0)
        if diameters.ndim and diameters.shape != np.shape(x):
            raise refused("diameter", diameter, correction)
        if diameters.ndim and taper:
            raise refused("taper", taper, "leave it out: it follows from the diameters at the points")
        check_number("stem", stem, "give a length from 0, for none, in the unit of the points", least=0.0)
        traced = traced_rod(x, y, scatter=scatter, length=length)
        whole, rigidity = (1.0, 1.0) if flexural_rigidity is None else (traced.length, flexural_rigidity)
        s = np.linspace(0.0, 1.0, _POINTS)
        negligible = _NEGLIGIBLE * traced.deviation(s).min() / max(float(np.abs(traced.rest_curvature(s)).max()), 1.0)
        series, misses = [traced.coefficients, *traced.modes(MOST_MODES)], [max(float(negligible), MISS), _NEGLIGIBLE]
        curvature, *modes = (
            along("rest_curvature", lambda s, c=c: chebyshev.evaluate(c, s / whole) / whole, whole, miss=misses[k > 0])
            for k, c in enumerate(series)
        )
        cone = measured_cone(traced.feet, diameters) if diameters.ndim else MeasuredCone(float(diameters), taper, 0.0)
        return cls(
            whole,
            rigidity,
            cone.diameter * whole / traced.length,
            rest_curvature=curvature,
            taper=cone.taper,
            rigidity_profile=rigidity_profile,
            rest_curvature_deviation=traced.deviation_of_mean / whole,
            stem=stem * whole / traced.length,
            rest_shape_modes=modes,
            taper_deviation=cone.deviation,
        )

    def mirrored(self, side: ArrayLike) -> Rods:
        """Return the rods of contacts with the sides +1, or −1 where they are mirrored, shape (n,)."""
        side = np.where(check_array("side", side) < 0.0, -1.0, 1.0)
        curvature = side * self.arc_curvature if self.profile is None else side
        return Rods(curvature, self.profile, self.stem / self.length)

    def in_lengths(self) -> Rod:
        """Return the rod in its own units, with a length and a flexural rigidity of 1."""
        curvature, rigidity = (
            of.scaled(1.0 / self.length, 1.0 / unit) if isinstance(of, Along) else None if of is None else of / unit
            for of, unit in ((self.rest_curvature, self.curvature_unit), (self.rigidity_profile, 1.0))
        )
        return Rod(
            diameter=self.diameter / self.length_unit,
            elastic_strain=self.elastic_strain,
            rest_curvature=curvature,
            taper=self.taper,
            rigidity_profile=rigidity,
            rest_curvature_deviation=self.rest_curvature_deviation / self.curvature_unit,
            stem=self.stem / self.length_unit,
            rest_shape_modes=[m.scaled(1.0 / self.length, 1.0 / self.curvature_unit) for m in self.rest_shape_modes],
            taper_deviation=self.taper_deviation,
        )

    def shape_in_words(self, unit: str) -> list[str]:
        """Return the differences from a straight, uniform rod as text, given the unit of curvatures, such as 1/m."""
        words = [f"stem {self.stem:.4g} {unit.removeprefix('1/')}"] if self.stem else []
        if isinstance(self.rest_curvature, Along):
            ends = self.rest_curvature([0.0, self.length])
            words.append(f"rest curvature {ends[0]:.4g} {unit} at the base to {ends[1]:.4g} {unit} at the tip")
        elif self.rest_curvature:
            words.append(f"rest curvature {self.rest_curvature:.4g} {unit}")
        if self.taper:
            words.append(f"taper {self.taper:.4g}")
        if isinstance(self.rigidity_profile, Along):
            words.append(f"rigidity at the tip {float(self.rigidity_profile(self.length)):.4g} of that at the base")
        return words

    def reshaped(
        self, mean_rest_curvature: float, taper: float, stem: float | None = None, length: float | None = None
    ) -> Rod:
        """Return a rod of another mean rest curvature [1/m], taper and, if given, stem [m] and length [m].

        In another length it has the same course of rest curvature and rigidity along it, in proportion.
        """
        curvature, rigidity = self.rest_curvature, self.rigidity_profile
        longer = 1.0 if length is None else length / self.length
        if isinstance(curvature, Along):
            curvature = curvature.scaled(longer, 1.0 / longer)
            curvature = curvature.plus(mean_rest_curvature - curvature.mean)
        else:
            curvature = mean_rest_curvature
        return replace(
            self,
            length=longer * self.length,
            rest_curvature=curvature,
            taper=taper,
            rigidity_profile=rigidity.scaled(longer, 1.0) if isinstance(rigidity, Along) else rigidity,
            rest_curvature_deviation=self.rest_curvature_deviation / longer,
            stem=self.stem if stem is None else stem,
            rest_shape_modes=[mode.scaled(longer, 1.0 / longer) for mode in self.rest_shape_modes],
        )

    def tapered_by(self, error: Any) -> Any:
        """Return the taper with an error in its standard deviations."""
        return np.clip(self.taper + error * self.taper_deviation, 0.0, STEEPEST_TAPER)[()]

    def shaped(self, amplitudes: ArrayLike) -> Rod:
        """Return the rod of which the amplitudes of the modes of its rest curvature are known, shape (modes,)."""
        if not np.any(amplitudes):
            return self
        curvature = self.rest_curvature
        if not isinstance(curvature, Along):
            curvature = Along((0.0, self.length), ((curvature,),))
        for z, mode in zip(np.asarray(amplitudes).tolist(), self.rest_shape_modes, strict=True):
            curvature = curvature.plus(mode.scaled(1.0, z))
        return replace(self, rest_curvature=curvature, rest_curvature_deviation=0.0, rest_shape_modes=())

    @property
    def is_uniform(self) -> bool:
        """True if the flexural rigidity is constant."""
        return self.taper == 0.0 and self.rigidity_profile is None

    @property
    def is_arc(self) -> bool:
        """True if the rod is uniform and its rest curvature constant: the equations have closed forms."""
        return self.is_uniform and isinstance(self.rest_curvature, float)

    @property
    def mean_rest_curvature(self) -> float:
        """Mean of the rest curvature [1/m]: the turn from base to tip over the length."""
        curvature = self.rest_curvature
        return curvature if isinstance(curvature, float) else float(curvature.mean)

    @property
    def arc_curvature(self) -> float:
        """Rest curvature of an arc [1/L]; 0 for rods with a `profile`."""
        return self.rest_curvature / self.curvature_unit if self.is_arc else 0.0

    @cached_property
    def profile(self) -> Profile | None:
        """Rest curvature and rigidity along the rod, dimensionless; None for arcs."""
        return None if self.is_arc else self.as_profile()

    def as_profile(self) -> Profile:
        """Return rest curvature and rigidity along the rod, dimensionless, of an arc too."""
        own = self.in_lengths()
        rigidity = 1.0 if own.rigidity_profile is None else own.rigidity_profile
        return profile_of(own.rest_curvature, rigidity, own.taper, own.rest_shape_modes)

    @property
    def surface(self) -> Surface:
        """Surface of the rod, dimensionless."""
        return Surface(0.5 * self.diameter / self.length, self.taper)

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
    def curvature_unit(self) -> float:
        """Unit of curvature, 1/L [1/m]."""
        return 1.0 / self.length

    @property
    def unit_sizes(self) -> dict[str, float]:
        """Sizes of the units of a dimensionless record, by the SI units in whose place they are.

        Examples
        --------
        >>> Rod(0.5, 2.0).unit_sizes["N m"]
        4.0
        """
        moment, length = self.moment_unit, self.length_unit
        sizes = {"N": self.force_unit, "N m": moment, "m": length, "1/m": self.curvature_unit}
        return sizes | {"1/N/m": 1.0 / moment, "1/N²/m²": 1.0 / moment**2}

    @property
    def load_units(self) -> Floats:
        """Units of the loads (holding_moment, force_x, force_y): EI/L [N m] and twice EI/L² [N]."""
        return np.array([self.moment_unit, self.force_unit, self.force_unit])


def round_rigidity(diameter: float, youngs_modulus: float) -> float:
    """Return E π d⁴ / 64, the flexural rigidity of a round rod."""
    fourth = float(diameter) ** 4 if diameter < _THICKEST else math.inf
    return youngs_modulus * math.pi * fourth / 64.0
