"""What a record says against a contour and a rig: residuals of its readings and of its snap-offs."""

from __future__ import annotations

import numpy as np
from scipy.special import huber

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.contours import Contour
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.reconstruction import loaded_samples

HUBER_THRESHOLD = 4.0  # residual in standard deviations from which Huber's loss is linear
_MIN_WIDTH = 0.01  # smallest standard deviation of a snap-off, over half a step of the drive angle


class Observer:
    """Residuals of contours and rigs with respect to the record."""

    def __init__(self, model: ContourModel) -> None:
        self.model = model
        self.loaded = model.certainly_loaded
        if not np.isfinite(model.zero[model.present]).all():  # hardly any sample is unloaded
            self.loaded = loaded_samples(model.measured, model.noise.stated_cell)
        stated = np.asarray(model.likelihood.load_cell.noise)
        self.noise = model.of_samples(np.where(stated > 0.0, stated, model.deviation))
        between = model.likelihood.segments.event_angles(self.loaded)[:, 2:]
        self.ends = np.isfinite(between).all(axis=1)
        self._end, self._within = between.mean(axis=1), 0.5 * np.diff(between, axis=1)[:, 0]
        self._width = self._within / np.sqrt(3.0)

    def __call__(self, contours: Contour, values: dict[str, Floats]) -> tuple[Floats, Flags, Floats]:
        """Return residuals of readings over `noise`, samples loaded as measured, and residuals of snap-offs.

        They are expected less measured; shapes (n, samples, 3), (n, samples) and (n, sweep segments that end).
        """
        model, rig = self.model, self.model.unknowns.rig(values)
        loads, _, events = model.likelihood.predict_with_events(contours, rig)
        agree = (loads != 0.0).any(axis=2) == self.loaded
        cell = model.likelihood.load_cell
        beyond = cell.expected(model.unknowns.sensed(loads, values, cell)) - model.likelihood.measured
        late = (events[..., 1] - self._end) / self._width
        beyond /= self.noise
        return beyond, agree, late[:, self.ends]

    def narrow_snap_offs(self, point: Floats) -> bool:
        """Reduce the widths of snap-offs that a point, (1, parameters), misses; return True if there are any."""
        _, _, late = self(self.model.contours(point), self.model.values(point))
        off = np.zeros(self._width.size, dtype=bool)
        off[self.ends] = np.abs(late[0]) * self._width[self.ends] > self._within[self.ends]
        off &= self._width > _MIN_WIDTH * self._within
        self._width = np.where(off, self._width / 3.0, self._width)
        return bool(off.any())

    def log_density(self, points: Floats) -> Floats:
        """Return a coarse log-likelihood, (n,), with Huber's loss, constant for samples loaded unlike the record's."""
        model = self.model
        residual, agree, late = self(model.contours(points), model.values(points))
        scale = model.noise_scale(points)
        cost = huber(HUBER_THRESHOLD, residual / scale[:, None])
        cost = np.where(agree[..., None], cost, 0.5 * HUBER_THRESHOLD)[..., model.present].sum(axis=(1, 2))
        volume = residual.shape[1] * np.log(scale[:, model.present]).sum(axis=1)
        return np.nan_to_num(-cost - volume - 0.5 * np.square(late).sum(axis=1), nan=-np.inf)
