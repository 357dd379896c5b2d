"""Posteriors that end where the model has no path: told by the share of displaced draws that are out of reach."""

import numpy as np
import pytest

from helpers.contour_posteriors import posterior
from tactile_bayes.diagnostics import reach_edge
from tactile_bayes.diagnostics.reach_edge import cut_off_parameters
from tactile_bayes.diagnostics.result_check import check
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood


def test_a_right_posterior_is_not_cut_off():
    assert cut_off_parameters(posterior()) == {}


@pytest.fixture
def walled(monkeypatch):
    """The model has no path along a contour whose lowest point is above the mean of the draws, less one deviation."""
    heights = posterior()["posterior"]["q"].values
    wall = float(np.quantile(heights, 0.9))
    usable = RecordLikelihood.usable

    def below(self, contours, rig=None):
        return usable(self, contours, rig) & (np.asarray(contours.q) <= wall)

    monkeypatch.setattr(RecordLikelihood, "usable", below)


def test_a_wall_among_the_draws_is_found_and_said_first(walled):
    assert cut_off_parameters(posterior())["q"] == "above"
    first = check(posterior()).messages[0]
    assert first.kind == "cut-off posterior"
    assert "q (above " in first.details["ends"]


def test_ends_of_a_prior_are_no_wall(walled, monkeypatch):
    monkeypatch.setattr(reach_edge.ContourModel, "log_prior", lambda self, points: np.full(len(points), -np.inf))
    assert cut_off_parameters(posterior()) == {}
