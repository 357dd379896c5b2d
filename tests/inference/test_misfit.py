"""Misfit: both family and rig are named, and nothing is suggested that was done already."""

import re

import pytest

from helpers.comparisons import made_up
from tactile_bayes.comparison.families import NONE_FITS, verdict_on
from tactile_bayes.inference.misfit import what_to_try

OF_ROD = ["rest_curvature", "taper", "stem", "length"]
YIELDING = ["suspension_compliance", "contact_compliance"]
SINGLE = ["friction", "backlash", *YIELDING, "lag", "play", "taper", "stem", "length"]
EVERY = ["friction", "gain", "drift", "lever", "backlash", *YIELDING, "lag", "play", *OF_ROD]


def suggested(unknowns, **stated):
    found = re.search(r"under \[unknown\] of rig\.toml: ([^)]*)\)", what_to_try(["parabola"], unknowns, **stated))
    return found[1].split(", ") if found else []


@pytest.mark.parametrize(
    ("inferred", "name"),
    [("moment_gain", "gain"), ("force_x_drift", "drift"), ("lever_x", "lever"), *((name, name) for name in SINGLE)],
)
def test_what_was_inferred_is_not_suggested(inferred, name):
    assert suggested([inferred]) == [other for other in EVERY if other != name]


def test_what_would_be_refused_is_not_suggested():
    assert suggested([], friction=0.2) == EVERY[1:]
    assert suggested(["discrepancy_length"]) == EVERY
    assert re.fullmatch("gain .* rigidity_scale", suggested(["rigidity_scale"])[1])


def test_where_everything_was_inferred_only_the_family_is_left():
    words = what_to_try(["circle"], ["friction", "moment_gain", "force_y_drift", "lever_y", "backlash", *EVERY[-8:]])
    assert "(--family shape-free, or compare)" in words
    assert "[unknown]" not in words


def test_the_smooth_family_is_not_suggested_where_it_was_tried_nor_any_beside_a_gauge():
    words = what_to_try(["parabola", "shape-free"])
    assert "another family (compare), " in words
    assert "shape-free" not in words
    words = what_to_try(["gauge"], ["rigidity_scale"])
    assert "gauge or the rig" in words
    assert "family" not in words


def test_a_comparison_in_which_none_fits_names_both():
    found = made_up([0.6, 0.4], fits=False).assign_attrs(nuisances='["rigidity_scale", "friction"]')
    words = verdict_on(found)
    assert words.startswith(f"{NONE_FITS} (parabola, circle). ")
    assert words.endswith(what_to_try(["parabola", "circle"], ["rigidity_scale", "friction"]))
