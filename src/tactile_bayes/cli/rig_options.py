"""Options that describe a rig: its simulated parts, and its unknowns."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tactile_bayes.cli.numbers import columns_in, numbers_asked

if TYPE_CHECKING:
    import xarray as xr

    from tactile_bayes.load_cell import LoadCell
    from tactile_bayes.mechanics.rods.rod import Rod

__all__ = ["Friction", "KnownRig", "NoiseOptions", "RigOptions", "RodOptions", "UnknownOptions", "rig_in"]

Friction = Annotated[float, typer.Option(help="Coulomb's coefficient, known.", min=0.0, max=0.84)]


@dataclass(frozen=True)
class NoiseOptions:
    """Noise of a simulated load cell."""

    force_noise: Annotated[
        float | None, typer.Option(help="Standard deviation of the forces [N, or EI/L²]; by default 0.05 EI/L².")
    ] = None
    moment_noise: Annotated[
        float | None, typer.Option(help="Standard deviation of the moment [N m, or EI/L]; by default 0.02 EI/L.")
    ] = None

    @property
    def load_cell(self) -> LoadCell | None:
        """The load cell, or None if no option gives one.

        Raises
        ------
        ParameterError
            If one of the two options is missing.
        """
        from tactile_bayes.errors import ParameterError
        from tactile_bayes.load_cell import LoadCell

        if self.force_noise is None and self.moment_noise is None:
            return None
        if not self.force_noise or not self.moment_noise:
            raise ParameterError("--force-noise and --moment-noise go together, above zero: give both, or neither")
        return LoadCell(force_noise=self.force_noise, moment_noise=self.moment_noise)


@dataclass(frozen=True)
class RodOptions:
    """A simulated rod."""

    length: Annotated[
        float | None,
        typer.Option(help="Rod length [m], if no file states it; by default all is in units of the rod."),
    ] = None
    flexural_rigidity: Annotated[float | None, typer.Option(help="EI [N m²], with --length.")] = None
    diameter: Annotated[float, typer.Option(help="Rod diameter [m], at the base.")] = 0.0
    rest_curvature: Annotated[
        float,
        typer.Option(help="Curvature of the unloaded rod, an arc [1/m, or 1/L]; > 0 counter-clockwise from the base."),
    ] = 0.0
    taper: Annotated[
        float, typer.Option(help="Part by which the diameter of a tapered rod has fallen at its tip, 0 to 0.95.")
    ] = 0.0
    stem: Annotated[
        float,
        typer.Option(help="Rigid, straight piece between pivot and rod [m, or L], as of a clamp on a hinge.", min=0.0),
    ] = 0.0
    rod_shape: Annotated[
        Path | None,
        typer.Option(
            help="CSV file with columns x and y [m], points traced along the unloaded rod from its base: its rest "
            "curvature, in place of --rest-curvature, and its length unless --length gives a larger one, beyond them."
        ),
    ] = None

    @property
    def rod(self) -> Rod | None:
        """The rod, or None if no option gives one.

        Raises
        ------
        ParameterError
            If options of the rod are missing, or contradict each other.
        """
        from tactile_bayes.errors import ParameterError
        from tactile_bayes.mechanics.rods.rod import Rod

        if self.rod_shape is not None:
            if self.rest_curvature:
                raise ParameterError("--rod-shape gives the rest curvature: leave out --rest-curvature")
            x, y = columns_in(self.rod_shape, ("x", "y"))
            return Rod.from_shape(
                x,
                y,
                self.flexural_rigidity,
                length=self.length,
                diameter=self.diameter,
                taper=self.taper,
                stem=self.stem,
            )
        if (self.length is None) != (self.flexural_rigidity is None):
            raise ParameterError("--length and --flexural-rigidity go together: give both, or neither")
        if self.diameter and self.length is None:
            raise ParameterError("--diameter needs --length and --flexural-rigidity beside it: give all three")
        if self.length is None or self.flexural_rigidity is None:
            return Rod(**self.shape) if self.shape else None
        return Rod(self.length, self.flexural_rigidity, self.diameter, **self.shape)

    @property
    def shape(self) -> dict[str, Any]:
        """Given properties by which the rod differs from a straight, uniform one."""
        given = {"rest_curvature": self.rest_curvature, "taper": self.taper, "stem": self.stem}
        return {name: value for name, value in given.items() if value}


@dataclass(frozen=True)
class RigOptions(RodOptions):
    """A simulated rod and its pivots."""

    base: Annotated[list[str] | None, typer.Option(help="A pivot, X,Y; may be repeated. By default one at 0,0.")] = None

    @property
    def pivots(self) -> list[tuple[float, ...]]:
        """Coordinates of the pivots."""
        return [numbers_asked(pivot, "--base", 2) for pivot in self.base or ["0,0"]]


KnownRig = Annotated[
    Path | None,
    typer.Option(
        help="rig.nc of calibrate-rig: its posterior is the prior of stiffness, encoder, lever, gains and shape of the "
        "rod, in place of the default priors; with --as-stated nothing else of the rig is inferred.",
        dir_okay=False,
    ),
]
"""File of a rig that a gauge has calibrated."""


def rig_in(path: Path | None) -> xr.DataTree | None:
    """Return the posterior of a rig from its file; None without a file.

    Raises
    ------
    InferenceError
        If there is no such file, or it holds no posterior or is damaged.
    """
    from tactile_bayes.inference.result import read_result

    return None if path is None else read_result(path)


@dataclass(frozen=True)
class UnknownOptions:
    """Unknowns of a rig that are inferred beside a contour."""

    friction: Annotated[
        float | None,
        typer.Option(help="Coulomb's coefficient, if known; else it is inferred.", min=0.0, max=0.84),
    ] = None
    nuisance: Annotated[
        list[str] | None,
        typer.Option(
            help="Unknown of the rig to be inferred, in place of rigidity_scale, drive_angle_offset, bias, lever, "
            "backlash and friction: one of these, standard (all of these), or drift, gain, moment_curve, "
            "suspension_compliance, rest_curvature, taper, stem, length, base (positions of further pivots), or gauge "
            "(place of the gauge, for calibrate-rig); may be repeated."
        ),
    ] = None
    as_stated: Annotated[
        bool, typer.Option("--as-stated", help="Assume the rig as stated: fewer parameters, narrower bands.")
    ] = False

    discrepancy: Annotated[
        bool,
        typer.Option(
            "--discrepancy",
            help="Infer a smooth deviation of the readings from the model as well, for hysteresis, stick-slip and the "
            "like: wider bands.",
        ),
    ] = False

    @property
    def nuisances(self) -> list[str]:
        """Names of the nuisance parameters that are inferred.

        Raises
        ------
        ParameterError
            If the options contradict each other.
        """
        from tactile_bayes.errors import ParameterError
        from tactile_bayes.inference.parameters.discrepancy import DISCREPANCY
        from tactile_bayes.inference.parameters.nuisances import STANDARD

        if self.as_stated and self.nuisance:
            raise ParameterError("--as-stated and --nuisance contradict each other: leave one of them out")
        smooth = [DISCREPANCY] if self.discrepancy else []
        return smooth if self.as_stated else [*(self.nuisance or STANDARD), *smooth]
