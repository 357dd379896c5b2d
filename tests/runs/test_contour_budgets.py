"""Time and memory of a run, as the operating system counts them, on records that no budget was made for."""

import os
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr

from helpers.contour_posteriors import CELL
from helpers.memory import COUNTING
from tactile_bayes.contours import Contour, Parabola, from_function
from tactile_bayes.record import write_record
from tactile_bayes.sweep import scan

pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform == "win32", reason="there is no wait4")]

SECONDS = 20  # time that is given
# Processor time beside it [s]: of compilers, if these have not run before, of the search for what is wrong with a model
# that does not describe the record, which has a limit of its own, and of all that is not bounded.
COMPILERS, CAUSES, ALLOWANCE = 45.0, 60.0, 25.0


SHAPES = {
    # |x/a|⁴ + |y/b|⁴: flatter than a shape-free contour likes to be, and with rounder corners
    "superellipse": lambda: from_function(
        lambda x: 0.9 - 0.5 * (1.0 - (np.abs(x) / 0.5) ** 4) ** 0.25, (-0.485, 0.485)
    ),
    # a corner that is rounded by 0.03
    "hyperbola": lambda: from_function(lambda x: 0.4 + 0.8 * np.hypot(x, 0.03) + 0.05 * x * x, (-0.9, 0.9)),
    "parabola": lambda: Parabola(0.5, q=0.5),
}


def record_of(contour: Contour, samples: int) -> xr.Dataset:
    """Sweeps in both directions, of as many samples each, from before first contact to past snap-off."""
    events = scan(contour, drive_step=np.radians(5.0)).events
    parts = []
    for k, direction in enumerate(("forward", "backward")):
        begin, end = (float(getattr(events[direction], e).drive_angle) for e in ("first_contact", "snap_off"))
        margin = 0.1 * (end - begin)
        angles = np.linspace(begin - margin, end + margin, samples)
        part = scan(contour, direction=direction, drive_angles=angles).record
        parts.append(part.assign(sweep=part.sweep + k))
    return CELL.measure(xr.concat(parts, "sample", combine_attrs="override"), rng=1)


@pytest.mark.parametrize(
    ("shape", "samples", "family", "gigabytes", "causes"),
    [
        ("superellipse", 500, "shape-free", 2.0, CAUSES),
        ("hyperbola", 500, "shape-free", 2.0, 0.0),
        ("parabola", 12_000, "parabola", 1.0, 0.0),
        ("parabola", 12_000, "shape-free", 1.0, 0.0),
    ],
)
def test_a_run_keeps_its_time_and_its_memory(shape, samples, family, gigabytes, causes, tmp_path):
    write_record(record_of(SHAPES[shape](), samples), tmp_path / "record.csv")
    command = f"infer record.csv --out run --family {family} --max-seconds {SECONDS} --quiet".split()
    threads = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    infer = [sys.executable, "-m", "tactile_bayes.cli", *command]
    done = subprocess.run(
        [sys.executable, "-c", COUNTING, "used", *infer],
        cwd=tmp_path,
        env=os.environ | threads,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    spent, peak = map(float, (tmp_path / "used").read_text().split())
    assert (tmp_path / "run" / "posterior.nc").exists()
    assert (tmp_path / "run" / "band.csv").exists()
    assert peak < gigabytes * 1e9
    # Processor time, for on a machine that others use, too, the clock says little of what comes after the time given.
    assert spent < SECONDS + COMPILERS + causes + ALLOWANCE
