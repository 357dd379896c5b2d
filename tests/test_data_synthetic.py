"""The records that come with the package are what it makes today."""

from pathlib import Path

import numpy as np

from tactile_bayes.demonstration import measure_demo
from tactile_bayes.record import read_record

FOLDER = Path(__file__).parents[1] / "data" / "synthetic"


def test_the_demonstration_is_reproduced(tmp_path):
    stored, made = read_record(FOLDER / "demonstration.csv"), read_record(measure_demo(tmp_path, seed=1))
    assert stored.attrs == made.attrs
    assert list(stored.data_vars) == list(made.data_vars)
    for name, column in stored.items():
        if column.dtype.kind == "f":
            np.testing.assert_allclose(made[name], column, rtol=1e-9, atol=1e-12)
        else:
            np.testing.assert_array_equal(made[name], column)
