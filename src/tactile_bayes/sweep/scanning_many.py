"""Step 1 for many contours of one family at once."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from tactile_bayes.checks import check_choice, check_numbers
from tactile_bayes.contours.base import Contour
from tactile_bayes.errors import ParameterError
from tactile_bayes.mechanics.phases import PHASE_NAMES
from tactile_bayes.mechanics.reachability import Reachability
from tactile_bayes.record.schema import column_attributes
from tactile_bayes.rig.rig import Rig, rig_of
from tactile_bayes.sweep.columns import ManyUnits, phases_of, sweep_events, sweep_samples
from tactile_bayes.sweep.path import Acting, frame_of


def scan_many(
    contours: Contour,
    drive_angles: ArrayLike,
    *,
    direction: Literal["forward", "backward"] = "forward",
    base: tuple[ArrayLike, ArrayLike] = (0.0, 0.0),
    rig: Rig | None = None,
) -> xr.Dataset:
    """Sweep the rod along many contours at once: some 8000 sweeps of 180 samples in a second.

    Loads are accurate to 1e-9 of the largest (1e-7 for rods whose shape or rigidity has kinks), contacts to 1e-10 of
    the path, and events to rounding. The equations are those of `scan`.

    Parameters
    ----------
    contours : Contour
        Contours with parameters of shape (n,); in metres if the rig states its rod, else in rod lengths.
    drive_angles : array_like, shape (k,) or (n, k)
        Drive angles, for all contours or for each [rad].
    direction : {"forward", "backward"}
        Sense of the drive.
    base : (array_like, array_like), each of shape () or (n,)
        Pivots, in the contours' unit of length.
    rig : Rig, optional
        As in `scan`.

    Returns
    -------
    xr.Dataset
        Over "contour" and "sample": drive_angle, holding_moment, force_x, force_y (0 out of contact), contact_x,
        contact_y, slope_angle, contact_arclength, tip_angle (NaN out of contact), contact_phase. Over "contour":
        status ("ok", or why the contour cannot be swept), clear (whether the unloaded rod is clear of it at the end),
        phases ("A-B": first tip, then tangential contact), and first_contact_* and snap_off_* with drive_angle,
        slope_angle, contact_x and contact_y. A contour that cannot be swept has no contact and NaN events.

    Raises
    ------
    ParameterError
        If shapes do not broadcast, drive angles exceed a turn, or another argument is invalid.

    Examples
    --------
    >>> from tactile_bayes.contours import Parabola
    >>> many = scan_many(Parabola(np.linspace(0.2, 2.0, 1000), q=0.5), np.linspace(0.5, 3.5, 180))
    >>> many.sizes["contour"], many.snap_off_drive_angle.values[[0, -1]].round(4)
    (1000, array([3.1218, 3.2172]))
    """
    check_choice("direction", direction, ("forward", "backward"))
    if not isinstance(contours, Contour):
        raise ParameterError(
            f"contours is a {type(contours).__name__}: give one contour whose parameters are arrays, as in "
            "Parabola(a=np.array([0.5, 0.7]), q=0.5); contours of several families are scanned one by one"
        )
    if len(contours.shape) != 1:
        raise ParameterError(
            f"contours with parameters of shape (n,) are wanted, not of shape {contours.shape}: for one contour, use "
            "scan"
        )
    acts, (count,) = Acting.of(rig_of(rig)), contours.shape
    correction = "give angles in radians, at most a turn (2π); those in degrees are converted by np.radians"
    angles = check_numbers("drive_angles", drive_angles, correction, least=-2.0 * np.pi, most=2.0 * np.pi)
    try:
        x, y = (np.broadcast_to(check_numbers("base", b), (count,)) for b in base)
        angles = np.broadcast_to(angles, (count, angles.shape[-1]))
    except (TypeError, ValueError, IndexError) as error:
        raise ParameterError(
            f"for {count} contours give bases as numbers or arrays of shape ({count},), and drive_angles of shape (k,) "
            f"or ({count}, k)"
        ) from error
    rod = acts.rod
    paths = acts.turn(frame_of(contours, count, (x, y), direction, rod), angles, polished=False)
    units = ManyUnits.of_rod(rod)
    system = "dimensionless" if rod.is_dimensionless else "SI"

    def labelled(dims: Any, values: NDArray[Any], name: str) -> tuple[Any, NDArray[Any], dict[str, str]]:
        return dims, values, column_attributes(name, system)

    both = ("contour", "sample")
    samples = {"drive_angle": angles, **sweep_samples(paths, units, np.arange(count))}
    samples["contact_phase"] = np.array(PHASE_NAMES)[samples["contact_phase"]]
    variables: dict[str, Any] = {name: labelled(both, values, name) for name, values in samples.items()}
    variables["status"] = ("contour", np.array([one.message for one in Reachability])[paths.reach])
    variables["clear"] = ("contour", paths.is_clear())
    variables["phases"] = ("contour", np.array(phases_of(paths), dtype=np.str_))
    for event, columns in sweep_events(paths, units).items():
        variables |= {f"{event}_{name}": labelled("contour", values, name) for name, values in columns.items()}
    return xr.Dataset(variables, attrs={"units": system, "direction": direction, "friction": acts.friction})
