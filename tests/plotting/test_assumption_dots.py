"""The figure of assumptions: how far each moves the contour."""

import numpy as np
import xarray as xr

from helpers.pictures import row_labels
from tactile_bayes.plotting import assumptions


def test_marks_lie_at_their_distances_and_rejected_ones_say_so():
    columns = {"moved_in_gap": [0.1, 2.0, np.nan], "moved_beside": [0.05, 3.0, 0.2], "fits": [1, 0, 1]}
    names = ["friction as stated", "family circle", "drift inferred"]
    ax = assumptions(xr.Dataset({name: ("assumption", of) for name, of in columns.items()}, {"assumption": names}))
    drawn = {line.get_label(): line.get_xdata() for line in ax.lines}
    assert drawn["in the gap"][0] == 0.1
    assert drawn["beside it"].tolist() == [0.05, 0.2]
    assert row_labels(ax)[1] == "family circle (rejected)"
