"""The load cell: a model of the sensor, which corrupts records and gives the likelihood of readings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_array, check_kind, check_optional, check_switch, refused
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell.data_sheet import DataSheet
from tactile_bayes.load_cell.discrepancy import Discrepancy
from tactile_bayes.load_cell.likelihood import checked_noise_scale, log_likelihood, wandering_sizes
from tactile_bayes.load_cell.lone_samples import covariance, squared_mahalanobis_distance
from tactile_bayes.load_cell.measurement import corrected, corrupted_loads, measured, stated_entries
from tactile_bayes.load_cell.zero_load import found_cell
from tactile_bayes.numerics.random_numbers import Rng, generator
from tactile_bayes.record import CHANNELS, frame_of, validate


@dataclass(frozen=True)
class LoadCell(DataSheet):
    """A load cell and an encoder at the pivot: one description for the corruption of records and their likelihood.

    With the loads h (holding moment and support reaction, zero out of contact) at the true drive angle φ, it reads

        y = gain · curve(lever(memory(h))) + bias + drift + ε, cut off at ± range, rounded to steps of the resolution,
        drive_angle = φ + offset ± backlash/2 + noise, rounded in the same way,

    where the memory is a lag and play, the lever changes the moment to m0 − x·force_y + y·force_x, the curve a moment M
    to M + a M² + b M³, and + is that of forward motion, − of backward.

    The default is an ideal sensor; every entry adds one flaw. Quantities are in the units of the record with which the
    cell is used: N and N m, or EI/L² and EI/L (a rod of 0.1 m and 1e-5 N m² has EI/L² = 1 mN, EI/L = 0.1 mN m). Entries
    of three numbers are for holding_moment, force_x and force_y.

    Parameters
    ----------
    force_noise, moment_noise : float
        Scale of the white noise ε on each force and on the moment: its standard deviation if it is normal. A data sheet
        calls it noise floor at the sampling rate. A good six-axis cell has some mN and 0.1 mN m; a cell that suits the
        rod has 0.001 to 0.05 of EI/L² and EI/L. If bands are too narrow, these values are too small.
    degrees_of_freedom : float
        Degrees of freedom of Student's t, the distribution of ε in each channel: ∞ for normal noise; 3 to 10 for knocks
        and sparks, which make one sample in a hundred an outlier. The scale stays force_noise and moment_noise.
    relative_noise : float
        Noise in proportion to the load, standard deviation (or scale) over reading, added in squares: 0.001 to 0.01 for
        a bridge with an unsteady supply.
    correlation : (float, float, float)
        Correlation coefficients of the noise of moment and force_x, moment and force_y, force_x and force_y, due to
        shared amplifiers and vibrations: 0 to ± 0.9.
    bias : (float, float, float)
        Reading without load: the weight of the rod, some 0.01 of EI/L² for a light one, or any value without a tare.
    bias_uncertainty : (float, float, float)
        Standard deviation of the unknown part of the bias, which is constant in a record: it is drawn once for each
        record, and the likelihood integrates over it. After taring on n samples it is noise/√n; `from_zero_load`
        estimates it.
    drift : RandomWalk or OrnsteinUhlenbeck, optional
        Drift of the zero from sample to sample through all sweeps of a record; the two classes state typical sizes. A
        drift of size zero is None.
    gain : three rows of (float, float, float)
        Readings (rows) by loads (columns): calibration errors on the diagonal, 1 ± 0.005, and cross-talk beside it,
        1 to 2 % of full scale. Between moment and force it has a unit of length or its inverse.
    lever : (float, float)
        Position of the cell's reference point for moments relative to the pivot, along the axes of the cell [length]:
        beside the axle a force contributes to the moment. Typically 0.005 of the rod's length if not measured. The axes
        of a turning cell are those along the rod at the pivot and across it.
    moment_curve : (float, float)
        Curve (a, b) of the moment's reading before the gain [1/(N m), 1/(N m)²], or dimensionless: that of a sensor
        whose reading is not in proportion to the moment, as a Hall sensor. Where the curve turns back, the sensor is
        saturated, and reads the same from there on. With counts in the column of the moment the gain is in counts per
        N m.
    lag, lag_seconds : float or (float, float, float)
        Time constant of a lag of first order, of all channels or of each, in readings, and in seconds for a record with
        a column of times, such as "time [s]" or time_ms: that of a low-pass filter. Both add up. Memory runs on from
        one sweep of a record to the next.
    play : float or (float, float, float)
        Play in all channels or in each, which makes a loop of hysteresis: half of the loop's width over the channel's
        largest load in a record. 0.001 for a good cell, 0.01 or more for a glued or printed one.
    force_range, moment_range : float
        Largest size of a reading, at which readings are cut off (with a resolution, at the last step in the range). A
        bridge is typically rated to twice the largest expected load.
    force_resolution, moment_resolution : float
        Step of the reading: range/32768 for a 16 bit converter; mostly below the noise.
    drive_angle_offset : float
        Encoder offset: its reading in zero position [rad]; 0.01 (about 0.5°) after alignment by eye.
    drive_angle_backlash : float
        Difference of the encoder's readings in forward and backward motion [rad]: half of it is added forward, and half
        subtracted backward. 0.003 (about 0.2°) for a gear; less if the encoder sits on the axle itself.
    drive_angle_noise, drive_angle_resolution : float
        Standard deviation of the encoder's noise [rad], mostly below a step, and its step [rad]: 2π/4096 = 0.0015 for
        one of 1024 lines. The rod follows the true angle, which is monotonic, and contact ends once.
    frame : {"fixed", "turning"}, optional
        Whether the cell measures forces along the axes of the laboratory, or turns with the drive; all entries are in
        its own frame. By default the frame of the record that it measures.

    Raises
    ------
    ParameterError
        If an entry is impossible; the message says what is possible.

    Examples
    --------
    >>> LoadCell(force_noise=0.05, moment_noise=0.02).standard_deviations["force_y"]
    0.05
    """

    @classmethod
    def from_record(cls, record: xr.Dataset) -> LoadCell | None:
        """Load cell from the data sheet in a record's attributes, in the record's units; None if there is none.

        Parameters
        ----------
        record : xr.Dataset
            A record. Its numeric attributes that begin with "load_cell_" are the data sheet; missing entries are ideal.
            The frame is the record's.

        Returns
        -------
        LoadCell or None

        Raises
        ------
        ParameterError
            If the data sheet is impossible.

        Examples
        --------
        >>> from tactile_bayes.rig import Rig, make_record
        >>> columns = {"sweep": 0, "direction": "forward", "drive_angle": [1.2], "holding_moment": [0.5]}
        >>> attrs = {"load_cell_moment_noise": 0.02}
        >>> record = make_record(columns, Rig(file={"missing": ["force_x", "force_y"]}), attrs=attrs)
        >>> LoadCell.from_record(record).moment_noise
        0.02
        """
        entries = stated_entries(validate(record))
        return cls.from_entries(entries) if entries else None

    @classmethod
    def from_zero_load(cls, record: xr.Dataset, *, false_alarm: float = 1e-3) -> LoadCell:
        """Load cell with bias, its uncertainty, and white noise estimated from a record's unloaded stretches.

        Parameters
        ----------
        record : xr.Dataset
            A record with samples before first contact or after snap-off, without labels; see `zero_load`.
        false_alarm : float
            Error probability, as in `zero_load`.

        Returns
        -------
        LoadCell
            In the record's units and frame. The noise of the forces is the root mean square of both, or the larger one
            if they differ significantly. A missing channel has neither bias nor noise. Further entries can be added
            with `dataclasses.replace`.

        Raises
        ------
        RecordError
            If fewer than 3 samples are certainly unloaded.
        ParameterError
            If `false_alarm` is not a probability below a half.

        Warns
        -----
        DriftWarning
            If the bias moved during the record.

        Examples
        --------
        >>> from tactile_bayes import scan
        >>> from tactile_bayes.contours import paper_profile
        >>> rig = LoadCell(force_noise=0.05, moment_noise=0.02, bias=(0.1, 0.0, 0.2))
        >>> cell = LoadCell.from_zero_load(rig.measure(scan(paper_profile("II", q=0.5)).record, rng=1))
        >>> round(cell.force_noise, 2), round(cell.bias[2], 1)
        (0.05, 0.2)
        """
        return cls(**found_cell(record, false_alarm=false_alarm))

    @property
    def standard_deviations(self) -> Mapping[str, float]:
        """Standard deviation of the white noise on each channel without load, in the order of `CHANNELS`.

        They are in the units of the cell, and infinite for Student's t with 2 degrees of freedom or fewer.
        """
        nu = self.degrees_of_freedom
        widening = 1.0 if math.isinf(nu) else math.sqrt(nu / (nu - 2.0)) if nu > 2.0 else math.inf
        return MappingProxyType({name: float(v) * widening for name, v in zip(CHANNELS, self.noise, strict=True)})

    @property
    def approximations(self) -> tuple[str, ...]:
        """Descriptions of approximations in `log_likelihood` for this load cell; infer_contour puts them in its result.

        Steps of the reading that count as noise cause small errors: with an unknown bias as large as the noise, and 10
        samples, steps of 0.5, 1 and 2 standard deviations of the noise change the log-likelihood by 0.00003, 0.0004 and
        0.004 per sample (standard deviation over records; the mean is less), and its difference between two loads one
        standard error apart by 0.0002, 0.003 and 0.03.

        Examples
        --------
        >>> LoadCell(force_noise=0.05, force_resolution=0.05, correlation=(0.0, 0.0, 0.5)).approximations
        ('beside correlated noise, the steps of the reading are taken for white noise of a twelfth of their square',)
        """
        wanders = bool(np.any(wandering_sizes(self)))
        if np.any(self.resolution) and (wanders or any(self.correlation)):
            beside = "drift or an unknown bias" if wanders else "correlated noise"
            return (
                f"beside {beside}, the steps of the reading are taken for white noise of a twelfth of their square",
            )
        return ()

    def measure(self, record: xr.Dataset, *, rng: Rng) -> xr.Dataset:
        """Measure a record with this load cell.

        Parameters
        ----------
        record : xr.Dataset
            A record without noise, in the units of the load cell. It is not changed.
        rng : int, numpy.random.SeedSequence or numpy.random.Generator
            Seed, or generator of the random numbers. A channel has the same white noise whether or not others are
            missing.

        Returns
        -------
        xr.Dataset
            The record with noise, in the frame of the cell. The true values are stored in columns truth_drive_angle (if
            the encoder is not ideal), truth_holding_moment, truth_force_x and truth_force_y, unless the record has them
            already. The data sheet is stored in attributes that begin with "load_cell_"; the variance of white noise
            from an earlier measurement is added.

        Raises
        ------
        RecordError
            If `record` is not a record, or the encoder's errors make it invalid.
        ParameterError
            If `rng` is none of these; if there is cross-talk from a missing channel;
            if a cell with more than white noise has measured the record before.

        Examples
        --------
        >>> from tactile_bayes.rig import Rig, make_record
        >>> columns = {"sweep": 0, "direction": "forward", "drive_angle": [1.2], "holding_moment": [0.5]}
        >>> ideal = make_record(columns, Rig(file={"missing": ["force_x", "force_y"]}))
        >>> measured = LoadCell(moment_noise=0.02).measure(ideal, rng=1)
        >>> float(measured["truth_holding_moment"][0]), round(float(measured["holding_moment"][0]), 3)
        (0.5, 0.507)
        """
        return measured(self, record, generator(rng))

    def corrected(self, record: xr.Dataset) -> xr.Dataset:
        """Correct a record for the known errors of this cell: bias, gain, lever, offset and backlash, not for memory.

        Use it for contact points, sample by sample. A likelihood takes the record as measured, since a corrected record
        no longer shows the ends of the range.

        Parameters
        ----------
        record : xr.Dataset
            A measured record, in the units of the load cell and in its frame.

        Returns
        -------
        xr.Dataset
            The corrected record, or the record itself if there is nothing to correct. After a correction of the gain,
            noise, steps and range differ from the data sheet.

        Raises
        ------
        ParameterError
            If the frames differ; if there is cross-talk, or a lever, from a missing channel.

        Examples
        --------
        >>> from tactile_bayes import scan
        >>> from tactile_bayes.contours import paper_profile
        >>> cell = LoadCell(bias=(0.1, 0.0, 0.2), drive_angle_offset=0.01)
        >>> ideal = scan(paper_profile("II", q=0.5)).record
        >>> back = cell.corrected(cell.measure(ideal, rng=1))
        >>> float(abs(back.force_y - ideal.force_y).max()) < 1e-15
        True
        """
        self.refuse_other_frame(record)
        return corrected(self, record)

    def refuse_other_frame(self, record: xr.Dataset) -> None:
        """Raise ParameterError if a record is not in the frame of this cell."""
        check_kind("the record", record, xr.Dataset, "give a record, as read_record returns it")
        if self.frame is not None and frame_of(record) != self.frame:
            raise ParameterError(
                f"the load cell is {self.frame}, but the record's forces are {frame_of(record)}: give the cell without "
                f"a frame, or in_frame(record, {self.frame!r})"
            )

    def simulate(
        self, loads: ArrayLike, *, rng: Rng, noise_scale: ArrayLike = 1.0, discrepancy: Discrepancy | None = None
    ) -> Floats:
        """Simulate the readings of loads, as arrays.

        Parameters
        ----------
        loads : array_like, shape (..., samples, 3)
            Loads in the order of `CHANNELS`, in the units and the frame of the load cell.
        rng : int, numpy.random.SeedSequence or numpy.random.Generator
            As in `measure`.
        noise_scale : array_like, broadcastable to shape (..., 3)
            Factor on the white noise of each channel.
        discrepancy : Discrepancy, optional
            Smooth deviation of the readings, in the units of the cell, for loads of its shape.

        Returns
        -------
        ndarray, shape (..., samples, 3)

        Raises
        ------
        ParameterError
            If the shape of loads, `rng` or a factor is impossible.

        Examples
        --------
        >>> LoadCell(force_resolution=0.25, moment_range=1.0).simulate([[2.0, 0.3, 0.1]], rng=1)
        array([[1.  , 0.25, 0.  ]])
        """
        check_optional("discrepancy", discrepancy, Discrepancy)
        given = check_array("loads", loads)
        if given.ndim < 2 or given.shape[-1] != len(CHANNELS):
            raise ParameterError(
                f"loads have the shape {given.shape}: give (..., samples, 3), with the channels {', '.join(CHANNELS)}"
            )
        scale = checked_noise_scale(noise_scale, given.shape)
        batch = np.broadcast_shapes(scale.shape[:-1], given.shape[:-2])
        every = np.broadcast_to(given, (*batch, *given.shape[-2:]))
        return corrupted_loads(self, every, generator(rng), scale, discrepancy)

    def covariance(self, loads: ArrayLike) -> Floats:
        """Covariance of the errors of readings for each sample by itself: errors that samples share count as noise.

        It includes white noise, in proportion to the loads too, correlations, drift, the uncertainty of the bias, and
        steps (a twelfth of their square).

        Parameters
        ----------
        loads : array_like, shape (n_samples, 3)
            Loads of the samples, beginning with the first of a record, since drift may grow. Their values matter only
            for noise in proportion to the load.

        Returns
        -------
        ndarray, shape (n_samples, 3, 3)
            In the squared units of the cell; infinite for Student's t with 2 degrees of freedom or fewer.

        Raises
        ------
        ParameterError
            If the loads are not numbers of that shape.

        Examples
        --------
        >>> cell = LoadCell(force_noise=0.03, moment_noise=0.02, bias_uncertainty=(0.0, 0.04, 0.0))
        >>> np.sqrt(np.diagonal(cell.covariance(np.zeros((1, 3)))[0])).round(3)
        array([0.02, 0.05, 0.03])
        """
        return covariance(self, _by_sample("loads", loads))

    @property
    def drive_angle_deviation(self) -> float:
        """Standard deviation of the encoder's error [rad]: noise, and steps as a twelfth of their square."""
        return math.hypot(self.drive_angle_noise, self.drive_angle_resolution / math.sqrt(12.0))

    def squared_mahalanobis_distance(self, readings: ArrayLike) -> Floats:
        """Squared Mahalanobis distance of readings from zero load.

        Without load it follows a χ² distribution with as many degrees of freedom as channels. Steps, drift and an
        unknown bias count as noise; a deviation under Student's t is replaced by the normal deviation of the same
        probability. The distribution is exact without steps, and without outliers beside drift or an unknown bias.
        Otherwise the quantile of 1 in 1000 samples is exceeded less often: by a factor of at most 3 for steps of up to
        two standard deviations of the noise, and of some 50 for outliers beside a bias of three times the noise.

        Parameters
        ----------
        readings : array_like, shape (n_samples, 3)
            As in `log_likelihood`, in the units and the frame of the cell. A channel without noise, steps or drift must
            be missing.

        Returns
        -------
        ndarray, shape (n_samples,)

        Raises
        ------
        ParameterError
            If the readings are not numbers of that shape.

        Examples
        --------
        >>> LoadCell(moment_noise=0.02).squared_mahalanobis_distance([[0.04, np.nan, np.nan]]).round(6)
        array([4.])
        """
        return squared_mahalanobis_distance(self, _by_sample("readings", readings))

    def log_likelihood(
        self,
        measured: ArrayLike,
        predicted: ArrayLike,
        *,
        noise_scale: ArrayLike = 1.0,
        pointwise: bool = False,
        discrepancy: Discrepancy | None = None,
    ) -> Floats:
        """Log-likelihood of readings, for one or many predictions; drive angles count as exact.

        It is exact for independent normal or Student's t noise, also with steps and cut-offs: the density of a reading
        is then the probability of its step (at the end of the range, of all values beyond). It is also exact for normal
        noise that is correlated between channels, or accompanied by drift or an unknown bias, which are integrated out;
        with steps, `approximations` describes the error. Combinations without a closed form are refused.

        Parameters
        ----------
        measured : array, shape (n_samples, 3)
            Readings in the order of `CHANNELS`, in the units of the load cell, samples in the order of measurement. A
            missing channel is NaN throughout.
        predicted : array, shape (..., n_samples, 3)
            Readings of an ideal sensor, in the same frame and units. Missing channels are ignored, unless they have
            cross-talk on others; NaN elsewhere gives NaN.
        noise_scale : array, broadcastable to shape (..., 3)
            Positive factor on the white noise of each channel, for a cell that is noisier than its data sheet. It does
            not apply to drift and bias_uncertainty.
        pointwise : bool
            Whether to return the terms of the samples instead of their sum; a term of dependent samples is conditional
            on the samples before it.
        discrepancy : Discrepancy, optional
            Smooth deviation of the readings that is integrated out exactly, in the units of the cell. Beside it, steps
            count as noise, as beside drift.

        Returns
        -------
        array, shape (...) or (..., n_samples)
            Normalised log-likelihood; 0 where every channel is missing.

        Raises
        ------
        ParameterError
            If a present channel has no noise, or lacks some of its samples; if a reading is beyond the range, a noise
            scale is not positive, or the shapes do not fit; if drift, an unknown bias or correlation is combined with
            outliers, or with a sample at the end of the range; if three of drift, unknown bias, correlation and
            relative_noise are combined; if a discrepancy is combined with outliers, a sample at the end of the range or
            correlation, or with drift in another order of samples.

        Examples
        --------
        >>> cell = LoadCell(force_noise=0.05, moment_noise=0.02)
        >>> moment_only = [[0.51, np.nan, np.nan]]
        >>> cell.log_likelihood(moment_only, [[[0.5, 0.0, 0.0]], [[0.51, 0.0, 0.0]]]).round(4)
        array([2.8681, 2.9931])
        """
        check_switch("pointwise", pointwise)
        return log_likelihood(self, measured, predicted, noise_scale, pointwise, discrepancy)

    def log_density_left_out(
        self,
        measured: ArrayLike,
        predicted: ArrayLike,
        *,
        noise_scale: ArrayLike = 1.0,
        discrepancy: Discrepancy | None = None,
    ) -> Floats:
        """Log-density of each sample given all others, for leave-one-out cross-validation.

        The channels of a sample are taken together. For independent samples this is the pointwise `log_likelihood`;
        with drift, an unknown bias or a discrepancy it is conditional on the samples before and after, exactly.

        Parameters
        ----------
        measured, predicted, noise_scale, discrepancy
            As in `log_likelihood`.

        Returns
        -------
        array, shape (..., n_samples)
            Log-densities in the units of the load cell; 0 where every channel is missing. For dependent samples they do
            not sum to the log-likelihood.

        Raises
        ------
        ParameterError
            As in `log_likelihood`.

        Examples
        --------
        >>> cell = LoadCell(moment_noise=0.02, bias_uncertainty=(1.0, 0.0, 0.0))
        >>> moment_only = [[0.5, np.nan, np.nan], [0.5, np.nan, np.nan], [0.6, np.nan, np.nan]]
        >>> cell.log_density_left_out(moment_only, np.zeros((3, 3))).round(1)  # the last is off by 0.1
        array([ 0.7,  0.7, -5.6])
        """
        return log_likelihood(self, measured, predicted, noise_scale, True, discrepancy, left_out=True)


def _by_sample(name: str, values: ArrayLike) -> Floats:
    """Return loads or readings of samples, shape (samples, 3)."""
    correction = f"give an array of shape (samples, 3), with the channels {', '.join(CHANNELS)}"
    numbers = check_array(name, values, correction)
    if numbers.ndim != 2 or numbers.shape[1] != len(CHANNELS):
        raise refused(name, values, correction)
    return numbers
