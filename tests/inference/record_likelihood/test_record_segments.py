"""The samples of a record by sweep segment."""

import numpy as np

from helpers.contour_posteriors import CELL
from tactile_bayes.contours import Parabola
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood
from tactile_bayes.inference.record_likelihood.record_segments import RecordSegments
from tactile_bayes.sweep import scan

RECORD = scan(Parabola(0.5, 0.5), drive_step=0.05).record


def test_events_lie_where_most_samples_say():
    """Also where some of them are taken for what they are not."""
    likelihood = RecordLikelihood(RECORD, CELL)
    loaded = (RECORD.force_y != 0.0).values
    events = likelihood.segments.event_samples(loaded)
    for row, direction in zip(events, ("forward", "backward"), strict=True):
        own = np.flatnonzero((RECORD.direction == direction).values)
        inside = own[loaded[own]]
        assert row.tolist() == [inside[0] - 1, inside[0], inside[-1], inside[-1] + 1]
    mistaken = loaded.copy()
    mistaken[[events[0, 3] + 3, events[1, 0] - 2, events[0, 1] + 4]] ^= True
    np.testing.assert_array_equal(likelihood.segments.event_samples(mistaken), events)
    angles = likelihood.segments.event_angles(loaded)
    contours = Parabola(np.array([0.5]), np.array([0.5]), np.array([0.0]))
    snap_offs = likelihood.predict_with_events(contours)[2][0, :, 1]
    assert np.all((angles[:, 2] < snap_offs) & (snap_offs < angles[:, 3]))


def test_no_events_without_a_load():
    segments = RecordSegments(RECORD, CELL)
    assert (segments.event_samples(np.zeros(RECORD.sizes["sample"], dtype=bool)) == -1).all()
