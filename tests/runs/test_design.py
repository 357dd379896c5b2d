"""The words of a design."""

import numpy as np
import pytest
import xarray as xr

from tactile_bayes.runs.design import design_messages


def found(places, widths, gaps):
    """Of candidates in metres."""
    x, y = np.transpose(places)
    count, metres = len(places), {"units": "m"}
    return xr.Dataset(
        {
            "base_x": ("candidate", x, metres),
            "base_y": ("candidate", y, metres),
            "drive_step": ("candidate", np.full(count, np.radians(2.0))),
            "drive": ("candidate", [f"turned about {place}" for place in places]),
            "is_pivot": ("candidate", np.ones(count, dtype=bool)),
            "samples": ("candidate", np.full(count, 242)),
            "information": ("candidate", np.full(count, 3.0)),
            "width": ("candidate", np.asarray(widths, dtype=float)),
            "gap": ("candidate", np.asarray(gaps, dtype=float)),
            "reached": ("candidate", np.ones(count)),
            "nested_width": ("candidate", np.full(count, np.nan)),
            "present_width": 5e-3,
            "best": int(np.argmin(widths)),
        },
        attrs={"probability": 0.95},
    )


GRID = [(-0.1, 0.0), (0.0, 0.0), (0.1, 0.0), (-0.1, 0.02), (0.0, 0.02), (0.1, 0.02), (0.0, -0.02)]


@pytest.mark.parametrize(
    ("best", "outermost"), [(1, None), (0, "leftmost"), (5, "rightmost and highest"), (6, "lowest")]
)
def test_the_outermost_candidate_is_said_to_be_so(best, outermost):
    widths = np.full(len(GRID), 2e-3)
    widths[best] = 1e-3
    words = design_messages(found(GRID, widths, np.full(len(GRID), 3e-3)))
    said = [sentence for sentence in words if sentence.startswith("It is the ")]
    if outermost is None:
        assert said == []
    else:
        assert said == [f"It is the {outermost} of the candidates: a better one may lie beyond, try more."]


def test_a_gap_that_is_not_known_is_not_told():
    first, *_ = design_messages(found(GRID[:2], [1e-3, 2e-3], [np.nan, 3e-3]))
    assert first.endswith("band is then 1 mm wide on the mean; now it is 5 mm.")


def test_drives_that_carry_the_base_have_words_and_what_they_tell_for_each_reading():
    carried = "carried from (0.1, 0) to (-0.1, 0) at 90°"
    made = found(GRID[:2], [1e-3, 4e-3], [3e-3, 3e-3])
    made.is_pivot[0], made.samples[0], made["drive"] = False, 100, ("candidate", [carried, "turned about (0, 0)"])
    words = design_messages(made)
    assert words[0].startswith(f"The best drive: {carried} [m], with 100 readings: the 95% band is then 1 mm wide")
    assert f"The most information per reading: {carried} [m], 3 nats in 100 readings." in words
    assert not any(sentence.startswith("It is the ") for sentence in words)
