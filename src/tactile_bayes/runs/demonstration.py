"""The demonstration: a rod, a load cell and an object that could stand on a table."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np

from tactile_bayes.contours import Parabola
from tactile_bayes.errors import ParameterError, RecordWarning, TactileBayesError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.numerics.random_numbers import Rng
from tactile_bayes.record import CHANNELS, MEASURED, rod_of, write_record
from tactile_bayes.rig import Rig, read_record
from tactile_bayes.runs.names import INFERENCE, OF_POSTERIOR
from tactile_bayes.sweep import scan
from tactile_bayes.tasks import replace_together

# Music wire, 200 mm long, 0.7 mm thick: EI = 2.43e-3 N m².
ROD = Rod.circular(length=0.2, diameter=0.7e-3, youngs_modulus=206e9)
CONTOUR = Parabola(a=2.5, q=0.1)  # profile II of the paper at q = 0.5, for a rod of 200 mm [m]
# A small six-axis cell: 3 mN and 0.25 mN m, or 0.049 EI/L² and 0.021 EI/L.
LOAD_CELL = LoadCell(force_noise=3e-3, moment_noise=0.25e-3)
TRUTH = {**vars(CONTOUR), "noise_scale": 1.0}
RIG = Rig(rod=ROD, load_cell=LOAD_CELL, unknown="nothing")  # the rig as it is stated


def measure_demo(out: str | os.PathLike[str], *, rng: Rng) -> tuple[Path, Path]:
    """Sweep forward and backward in steps of 1°, and write record.csv, without the truth, and rig.toml."""
    measured = LOAD_CELL.measure(scan(CONTOUR, Rig(rod=ROD)).record, rng=rng)
    path, rig = Path(out) / "record.csv", Path(out) / "rig.toml"
    _refuse_another(path, _is_record)
    _refuse_another(rig, lambda path: Rig.read(path).text == RIG.text)
    path.parent.mkdir(parents=True, exist_ok=True)
    measured = measured.drop_vars([name for name in measured.data_vars if str(name).startswith("truth_")])
    # A run that is there is of another record.
    with replace_together(path.parent, [*INFERENCE, *OF_POSTERIOR, path.name, rig.name]) as temporary:
        write_record(measured, temporary / path.name)
        RIG.write(temporary / rig.name)
    return path, rig


def _refuse_another(path: Path, is_of_demo: Callable[[Path], bool]) -> None:
    """Refuse to replace what is not the demonstration's."""
    if not os.path.lexists(path):
        return
    with suppress(TactileBayesError, OSError):
        if is_of_demo(path):
            return
    raise ParameterError(
        f"{path} is no {path.stem} of the demonstration, which would replace it: give another folder, as in "
        "tactile-bayes demo --out results/demo"
    )


def _is_record(path: Path) -> bool:
    """Return whether a record differs from those of the demonstration in its noise alone."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RecordWarning)
        found = read_record(path)
    if (rod_of(found), LoadCell.from_record(found)) != (ROD, LOAD_CELL):
        return False
    ideal = scan(CONTOUR, Rig(rod=ROD)).record
    fixed = [name for name in MEASURED if name not in CHANNELS]
    return found.sizes == ideal.sizes and all(np.array_equal(found[name], ideal[name]) for name in fixed)
