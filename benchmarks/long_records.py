"""Time and memory of an inference with a time limit, by the number of samples of the record, each in a new process."""

from __future__ import annotations

import subprocess
import sys
import time
import warnings

import numpy as np

SAMPLES = 1_000, 3_000, 24_000, 200_000
_SECONDS = 3.0


def main() -> None:
    print(f"infer_contour with max_seconds={_SECONDS:g}")
    print(f"{'samples':>8}  {'taken':>6}  {'wall':>7}  {'processor':>9}  {'memory':>8}")
    for samples in SAMPLES:
        subprocess.run([sys.executable, "-m", "benchmarks.long_records", str(samples)], check=True)


def _one(samples: int) -> None:
    import tactile_bayes as tb
    from tactile_bayes.contours import paper_profile

    cell, contour = tb.LoadCell(force_noise=0.05, moment_noise=0.02), paper_profile("II", q=0.5)
    settings = tb.SamplerSettings(max_seconds=_SECONDS)
    for count in (300, samples):  # the first one waits for compiled code
        record = cell.measure(tb.scan(contour, drive_step=np.radians(268.0) / count).record, rng=1)
        began, busy = time.perf_counter(), time.process_time()
        result = tb.infer_contour(record, rng=1, settings=settings)
        wall, processor = time.perf_counter() - began, time.process_time() - busy
    taken, memory = result["observed_data"].sizes["sample"], _peak() / 1e9
    print(f"{record.sizes['sample']:8,}  {taken:6,}  {wall:5.1f} s  {processor:7.1f} s  {memory:5.2f} GB")


def _peak() -> float:
    """Return the largest memory of this process since it began [bytes], on Linux."""
    with open("/proc/self/status", encoding="ascii") as status:  # ru_maxrss would begin with that of its parent
        return next(int(line.split()[1]) for line in status if line.startswith("VmHWM:")) * 1024.0


if __name__ == "__main__":
    if len(sys.argv) > 1:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            _one(int(sys.argv[1]))
    else:
        main()
