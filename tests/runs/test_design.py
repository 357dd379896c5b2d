"""The words of a design."""

import re

import numpy as np
import pytest
import xarray as xr

from tactile_bayes.runs.plans import design_messages


def found(places, widths, gaps):
    """Of candidates in metres."""
    x, y = np.transpose(places)
    columns = {"base_x": x, "base_y": y, "width": widths, "gap": gaps, "drive_step": np.radians(2.0), "reached": 1.0}
    columns |= {"samples": 242, "information": 3.0, "nested_width": np.nan, "is_pivot": True}
    columns["drive"] = [f"turned about {place}" for place in places]
    made = xr.Dataset({name: ("candidate", np.array(np.broadcast_to(of, len(x)))) for name, of in columns.items()})
    made["base_x"].attrs["units"] = made["base_y"].attrs["units"] = "m"
    return made.assign(present_width=5e-3, best=int(np.argmin(widths))).assign_attrs(probability=0.95)


GRID = [(-0.1, 0.0), (0.0, 0.0), (0.1, 0.0), (-0.1, 0.02), (0.0, 0.02), (0.1, 0.02), (0.0, -0.02)]


@pytest.mark.parametrize(
    ("best", "outermost"), [(1, None), (0, "leftmost"), (5, "rightmost and highest"), (6, "lowest")]
)
def test_the_outermost_candidate_is_said_to_be_so(best, outermost):
    widths = np.full(len(GRID), 2e-3)
    widths[best] = 1e-3
    words = design_messages(found(GRID, widths, np.full(len(GRID), 3e-3)))
    said = [sentence.partition(" of the candidates")[0] for sentence in words if "of the candidates" in sentence]
    assert said == ([] if outermost is None else [f"It is the {outermost}"])


def test_a_gap_that_is_not_known_is_not_told():
    first, *_ = design_messages(found(GRID[:2], [1e-3, 2e-3], [np.nan, 3e-3]))
    assert re.findall(r"\S+ mm", first)[-2:] == ["1 mm", "5 mm"]


def test_drives_that_carry_the_base_have_words_and_what_they_tell_for_each_reading():
    carried = "carried from (0.1, 0) to (-0.1, 0) at 90°"
    made = found(GRID[:2], [1e-3, 4e-3], [3e-3, 3e-3])
    made.is_pivot[0], made.samples[0], made["drive"] = False, 100, ("candidate", [carried, "turned about (0, 0)"])
    words = design_messages(made)
    assert [part for part in (f"{carried} [m], ", "100 readings", "95%", "1 mm") if part not in words[0]] == []
    assert any(f"{carried} [m], 3 nats in 100 readings" in sentence for sentence in words)
    assert not any("of the candidates" in sentence for sentence in words)
