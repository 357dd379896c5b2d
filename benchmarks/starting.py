"""Times of a start: importing this package, and printing the help of its command, beside importing scipy.stats."""

from __future__ import annotations

import subprocess
import sys

from benchmarks.table import Row, best_time


def starting() -> list[Row]:
    """Time starts in new processes, the interpreter's start included."""
    reference = _time("import scipy.stats")
    return [
        Row("start: import scipy.stats / import tactile_bayes", reference, _time("import tactile_bayes")),
        Row(
            "start: import scipy.stats / tactile-bayes --help",
            reference,
            _time("from tactile_bayes.cli import app; app(['--help'])"),
        ),
    ]


def _time(code: str) -> float:
    return best_time(
        lambda: subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL), repeats=3
    )


if __name__ == "__main__":
    from benchmarks.table import print_ratios

    print_ratios(starting())
