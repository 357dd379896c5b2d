"""Figures of single contacts: ellipses and regions."""

import numpy as np
import pytest
from matplotlib import colors
from matplotlib import pyplot as plt
from matplotlib.patches import Ellipse

import tactile_bayes as tb
from helpers.contact_posteriors import CELL, SI_CELL, measured
from helpers.pictures import labels, own_axes
from helpers.refusals import refused
from tactile_bayes.contours import paper_profile
from tactile_bayes.errors import ParameterError
from tactile_bayes.plotting import contact_ellipses, contact_regions
from tactile_bayes.uncertainty.contact_region import contact_region

SOME = np.array([2, 22, 24, 30, 45, 61, 120])


@pytest.fixture(scope="module")
def posterior():
    return tb.infer_contacts(measured().isel(sample=SOME), rig=tb.Rig(load_cell=CELL), rng=1, draws=400)


@pytest.fixture(scope="module")
def contacts():
    return tb.reconstruct(measured(), method="constrained", rig=tb.Rig(load_cell=CELL))


def outlines(ax):
    return [part for part in ax.collections if getattr(part, "levels", None) is not None]


def test_ellipses_are_those_of_the_covariance(contacts):
    ax = contact_ellipses(contacts, probability=0.9, samples=[45, 120], ax=own_axes())
    ellipses = [patch for patch in ax.patches if isinstance(patch, Ellipse)]
    assert len(ellipses) == 2
    for i, ellipse in zip((45, 120), ellipses, strict=True):
        at = contacts.isel(sample=i)
        spread_x, spread_y, rho = (
            float(at[name]) for name in ("contact_x_sd", "contact_y_sd", "contact_xy_correlation")
        )
        shared = rho * spread_x * spread_y
        precision = np.linalg.inv([[spread_x**2, shared], [shared, spread_y**2]])
        turns = np.linspace(0.0, 2.0 * np.pi, 7)
        rim = ellipse.get_patch_transform().transform(np.stack([np.cos(turns), np.sin(turns)], axis=-1))
        off = rim - [float(at.contact_x), float(at.contact_y)]
        np.testing.assert_allclose(np.einsum("ni,ij,nj->n", off, precision, off), 2.0 * np.log(10.0), rtol=1e-6)
        phase = str(at.contact_phase.values)
        assert colors.to_hex(ellipse.get_edgecolor()) == colors.to_hex(tb.plotting.PALETTE[phase])


def test_regions_are_outlined_at_their_level(posterior):
    ax = contact_regions(posterior, probability=0.5, ax=own_axes())
    drawn = outlines(ax)
    assert len(drawn) == SOME.size - 1
    for i, part in zip(range(1, SOME.size), drawn, strict=True):
        region = contact_region(posterior, i, 0.5)
        rim = np.concatenate([path.vertices for path in part.get_paths()])
        np.testing.assert_allclose(region.density(*rim.T), region.level, rtol=0.25)


def test_labels_say_probability_phase_and_unit(contacts, posterior):
    ax = contact_ellipses(contacts, probability=0.5, samples=[45], ax=own_axes())
    assert labels(ax)[0] == "50 % ellipse, tangential contact"
    ax = contact_regions(posterior, probability=0.95, truth=paper_profile("II", q=0.5), ax=own_axes())
    assert labels(ax)[:2] == ["95 % region, tip contact", "95 % region, tangential contact"]
    assert ax.get_aspect() == 1.0
    in_si = tb.reconstruct(measured("SI"), method="constrained", rig=tb.Rig(load_cell=SI_CELL))
    assert "m]" in contact_ellipses(in_si, ax=own_axes()).get_xlabel()


def test_the_true_contour_leaves_the_limits_alone(posterior):
    plain = contact_regions(posterior, ax=own_axes())
    true = contact_regions(posterior, truth=paper_profile("II", q=0.5), ax=own_axes())
    assert true.get_xlim() == plain.get_xlim()
    assert true.get_ylim() == plain.get_ylim()


def test_samples_without_a_contact_are_refused(contacts, posterior):
    with refused(ParameterError, "contact", "standard deviation"):
        contact_ellipses(contacts, samples=[0, 1], ax=own_axes())
    with refused(ParameterError, "contact"):
        contact_regions(posterior, samples=[0], ax=own_axes())


def test_a_region_is_whole_and_a_low_map_is_in_a_low_figure(contacts, posterior):
    ax = contact_regions(posterior)
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    for part in outlines(ax):
        for corners in (c for path in part.get_paths() for c in path.to_polygons(closed_only=False)):
            x, y = np.transpose(corners)
            assert left < x.min() < x.max() < right
            assert bottom < y.min() < y.max() < top
    for drawn in (ax, contact_ellipses(contacts)):
        wide, high = drawn.figure.get_size_inches()
        assert wide == 7.0
        assert high < 4.0
    assert len([patch for patch in drawn.patches if isinstance(patch, Ellipse)]) == 12  # by default
    _, given = plt.subplots(figsize=(5.0, 5.0))
    contact_ellipses(contacts, ax=given)
    np.testing.assert_array_equal(given.figure.get_size_inches(), 5.0)
