"""Everything in one answer: its groups are those of the single analyses, its words are true and in the right unit."""

import re
from functools import cache

import numpy as np
import pytest
import xarray as xr

import tactile_bayes as tb
from helpers.refusals import refused
from tactile_bayes.contours import Parabola, paper_profile
from tactile_bayes.errors import ParameterError, ReachError
from tactile_bayes.planning.amplification import amplification
from tactile_bayes.planning.information import information
from tactile_bayes.planning.noise_shares import noise_shares
from tactile_bayes.planning.plan import Plan
from tactile_bayes.planning.requirement import required_noise
from tactile_bayes.planning.sensitivity import PARTS

PROFILE = paper_profile("II", q=0.5)
STEP = 0.1


@cache
def plain(rod=None):
    return tb.sensitivity(rng=1, samples=4, drive=tb.Rotation(drive_step=STEP), rig=tb.Rig(rod=rod))


def in_si():
    return plain(tb.Rod(length=0.2, flexural_rigidity=2e-3))


def words(tree, part):
    """Sentences in which something is said."""
    return [line for line in tree.attrs["words"].split("\n") if re.search(part, line)]


@pytest.mark.slow
def test_the_groups_are_those_of_single_analyses():
    tree, plan = plain(), Plan(PROFILE, drive=tb.Rotation(drive_step=STEP))
    assert set(tree.children) == set(PARTS)
    singly = {
        "amplification": amplification(plan),
        "information": information(plan),
        "noise_shares": noise_shares(plan, rng=1, samples=4),
        "required_noise": required_noise(plan, [0.0005, 0.001, 0.0025, 0.005, 0.01]),
    }
    for name, right in singly.items():
        xr.testing.assert_identical(tree[name].to_dataset(), right)


def test_without_a_contour_it_is_profile_ii_scaled_to_the_rod():
    assert plain().attrs["contour"] == repr(PROFILE)
    assert in_si().attrs["contour"] == "Parabola(a=2.5, q=0.1, x_c=0.0)"
    si, dimensionless = (tree["required_noise"] for tree in (in_si(), plain()))
    np.testing.assert_allclose(si.band_width, 0.2 * dimensionless.band_width)
    np.testing.assert_allclose(si.noise_factor, dimensionless.noise_factor, rtol=1e-4)


def test_words_say_the_numbers_in_the_units_of_the_record():
    assert not re.search(r"\bmm\b|\bmN\b", plain().attrs["words"])
    assert "EI/L" not in in_si().attrs["words"]
    (line,) = words(in_si(), "expected width")
    for kind in ("touched", "gap"):
        assert f"{1e3 * float(in_si()['information'][f'{kind}_width']):.3g} mm " in line
    needed, lines = in_si()["required_noise"], words(in_si(), "^A mean band")
    assert len(lines) == 5
    width, noise = 1e3 * float(needed.band_width[0]), 1e3 * float(needed.force_noise[0])
    assert f"{width:.3g} mm needs {noise:.2g} mN" in lines[0]


def test_words_name_the_channel_that_is_missed_most():
    """Without the moment bounds grow most, as plans without it say."""
    (line,) = words(plain(), "^Most information")
    told = plain()["information"]
    ratio = (told.bound_without_channel / told.bound_with_priors).drop_sel(parameter="noise_scale")
    mean = np.exp(np.log(ratio).mean("parameter"))
    assert str(mean.channel[int(np.argmax(mean.values))].values) == "holding_moment"
    assert "without the moment" in line
    assert f"{float(mean.max()):.1f} times" in line


@pytest.mark.parametrize("first", [tb.Rotation(), tb.Translation((-0.8, 0.0), 0.0, np.pi - 1.1, 1.6)])
def test_a_drive_that_carries_the_base_adds_to_what_is_known(first):
    carried = tb.Translation((0.8, 0.0), np.pi, 1.1, 1.6)
    circle, parts = tb.contours.Circle(0.3, 0.8), ["information", "required_noise"]
    found = [tb.sensitivity(circle, rng=1, drive=d, parts=parts) for d in ([first], [first, carried])]
    alone, both = (each["information"].bound.sel(parameter=["r", "q", "x_c"]) for each in found)
    assert np.all(np.isfinite(alone))
    assert np.all(both <= alone + 1e-12)


LOUD = tb.Rig(load_cell=tb.LoadCell(force_noise=50.0, moment_noise=20.0))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"parts": ["required_noise"], "band_widths": [100.0]}, r"\b100 L .*\bpriors\b"),
        ({"parts": ["amplification"], "rig": LOUD}, "for no raw"),
        ({"parts": ["information"], "drive": tb.Rotation(direction="backward", drive_step=STEP)}, "expected width"),
    ],
    ids=["a band that priors give", "first order does not hold", "one sweep"],
)
def test_words_say_what_is_particular(options, said):
    tree = tb.sensitivity(rng=1, **options)
    assert set(tree.children) == set(options["parts"])  # only what is asked for is made
    (line,) = words(tree, said)
    assert "gap" not in line


@pytest.mark.parametrize(
    ("options", "error", "named"),
    [
        ({"parts": ["information", "gap"]}, ParameterError, ["parts", "['information', 'gap']"]),
        ({"rig": tb.Rig(load_cell=tb.LoadCell(moment_noise=0.02))}, ParameterError, ["force_x, force_y"]),
        ({"contour": Parabola(0.5, 1.5)}, ReachError, ["out of reach"]),
    ],
)
def test_what_is_impossible_is_refused(options, error, named):
    with refused(error, *named):
        tb.sensitivity(rng=1, **options)
