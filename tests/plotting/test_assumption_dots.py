import numpy as np
import xarray as xr
from matplotlib import pyplot as plt

from tactile_bayes.plotting import assumptions


def example():
    return xr.Dataset(
        {
            "moved_in_gap": ("assumption", [0.1, 2.0, np.nan]),
            "moved_beside": ("assumption", [0.05, 3.0, 0.2]),
            "fits": ("assumption", [1, 0, 1]),
        },
        coords={"assumption": ["friction as stated", "family circle", "drift inferred"]},
    )


def test_marks_lie_at_their_distances_and_rejected_ones_say_so():
    _, ax = plt.subplots()
    assert assumptions(example(), ax=ax) is ax
    drawn = {line.get_label(): line.get_xdata() for line in ax.lines}
    assert drawn["in the gap"][0] == 0.1
    assert drawn["beside it"].tolist() == [0.05, 0.2]
    assert [text.get_text() for text in ax.get_yticklabels()][1] == "family circle (rejected)"
