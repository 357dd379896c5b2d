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
from tactile_bayes.planning.sensitivity import PARTS, sensitivity
from tactile_bayes.rig import Rig

ROD = tb.Rod(length=0.2, flexural_rigidity=2e-3)
PROFILE = paper_profile("II", q=0.5)
STEP = 0.1


@cache
def plain():
    return tb.sensitivity(rng=1, samples=4, drive=tb.Rotation(drive_step=STEP))


@cache
def in_si():
    return tb.sensitivity(rng=1, samples=4, drive=tb.Rotation(drive_step=STEP), rig=Rig(rod=ROD))


def words(tree):
    return tree.attrs["words"].split("\n")


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
    np.testing.assert_allclose(in_si()["required_noise"].band_width, 0.2 * plain()["required_noise"].band_width)
    np.testing.assert_allclose(
        in_si()["required_noise"].noise_factor, plain()["required_noise"].noise_factor, rtol=1e-4
    )


def test_words_are_in_the_units_of_the_record():
    dimensionless, si = plain().attrs["words"], in_si().attrs["words"]
    assert " L along the contour" in dimensionless
    assert "EI/L²" in dimensionless
    assert not re.search(r"\bmm\b|\bmN\b", dimensionless)
    assert " mm along the contour" in si
    assert re.search(r"\d mN .*\d mN m ", si)
    assert "EI/L" not in si


def test_words_say_the_numbers():
    told = in_si()["information"]
    (line,) = [line for line in words(in_si()) if "expected width" in line]
    touched, gap = (1e3 * float(told[f"{kind}_width"]) for kind in ("touched", "gap"))
    for part in ("95%", f"{touched:.3g} mm where", f"{gap:.3g} mm in the gap"):
        assert part in line
    needed = in_si()["required_noise"]
    lines = [line for line in words(in_si()) if line.startswith("A mean band")]
    assert len(lines) == 5
    assert (
        f"of {1e3 * float(needed.band_width[0]):.3g} mm needs {1e3 * float(needed.force_noise[0]):.2g} mN" in lines[0]
    )
    (line,) = [line for line in words(in_si()) if "Toward first contact" in line]
    assert "to the power of -1.0" in line


def test_words_name_the_channel_that_is_missed_most():
    """Without the moment bounds grow most, as plans without it say."""
    (line,) = [line for line in words(plain()) if line.startswith("Most information")]
    told = plain()["information"]
    ratio = (told.bound_without_channel / told.bound_with_priors).drop_sel(parameter="noise_scale")
    mean = np.exp(np.log(ratio).mean("parameter"))
    assert str(mean.channel[int(np.argmax(mean.values))].values) == "holding_moment"
    assert "without the moment" in line
    assert f"{float(mean.max()):.1f} times" in line


def test_only_what_is_asked_for_is_made():
    tree = sensitivity(rng=1, parts=["required_noise"], band_widths=[0.002])
    assert set(tree.children) == {"required_noise"}
    assert [line[:11] for line in words(tree)] == ["A mean band"]
    needed = tree["required_noise"]
    assert needed.sizes == {"band_width": 1}


def test_an_answer_can_be_written_and_read(tmp_path):
    tree = plain()
    tree.to_netcdf(tmp_path / "sensitivity.nc", engine="h5netcdf")
    with xr.open_datatree(tmp_path / "sensitivity.nc", engine="h5netcdf") as back:
        assert back.groups == tree.groups
        for name in tree.groups:
            xr.testing.assert_allclose(back[name].to_dataset(), tree[name].to_dataset())
        assert back.attrs["words"] == tree.attrs["words"]


def test_a_wide_band_is_what_priors_give():
    tree = sensitivity(rng=1, parts=["required_noise"], band_widths=[100.0])
    (line,) = words(tree)
    assert re.search(r"\b100 L .*\bpriors\b", line)


def test_where_first_order_does_not_hold_the_words_say_so():
    loud = tb.LoadCell(force_noise=50.0, moment_noise=20.0)
    tree = sensitivity(rng=1, parts=["amplification"], rig=Rig(load_cell=loud))
    assert any("for no raw" in line for line in words(tree))


@pytest.mark.parametrize("parts", [["informations"], "information", [], ["information", "gap"]])
def test_parts_that_are_none_are_refused(parts):
    with refused(ParameterError, parts=parts):
        sensitivity(rng=1, parts=parts)


def test_a_channel_without_noise_is_refused_by_name():
    with refused(ParameterError, "force_x, force_y"):
        sensitivity(rng=1, rig=Rig(load_cell=tb.LoadCell(moment_noise=0.02)))


def test_a_contour_of_no_family_is_refused_with_the_correction():
    x = np.linspace(-1.0, 1.0, 41)
    for parts in (PARTS, ["information"]):
        with refused(ParameterError, "family", "parabola, circle, ellipse"):
            sensitivity(tb.contours.from_points(x, 0.5 * x**2 + 0.5), rng=1, parts=parts)


def test_a_contour_out_of_reach_is_refused():
    with refused(ReachError, "out of reach"):
        sensitivity(Parabola(0.5, 1.5), rng=1)


def test_one_sweep_has_no_gap_to_speak_of():
    tree = sensitivity(PROFILE, rng=1, drive=tb.Rotation(direction="backward", drive_step=STEP), parts=["information"])
    (line,) = [line for line in words(tree) if "expected width" in line]
    assert "gap" not in line
