"""The load cell: what a sensor does to a record, and how likely what it measured is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_seed
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell.corruption import corrupted_loads
from tactile_bayes.load_cell.covariance import covariance, surprise
from tactile_bayes.load_cell.data_sheet import DataSheet
from tactile_bayes.load_cell.likelihood import (
    approximations,
    checked_noise_scale,
    log_density_left_out,
    log_likelihood,
)
from tactile_bayes.load_cell.measurement import corrected, measured, stated_entries
from tactile_bayes.load_cell.zero_load import found_cell
from tactile_bayes.record import CHANNELS, frame_of, validate

__all__ = ["LoadCell"]


@dataclass(frozen=True)
class LoadCell(DataSheet):
    """A load cell and an encoder at the pivot: one description, to corrupt a record and to say how likely one is.

    With h the loads (holding moment and support reaction, zero out of contact) at the true drive angle φ, it reads

        y = gain · lever(h) + bias + drift + ε, cut off at ± range, rounded to steps of the resolution,
        drive_angle = φ + offset ± backlash/2 + noise, rounded likewise,

    where the lever makes the moment m0 − x·force_y + y·force_x, and + is for forward motion, − for backward.

    The default is an ideal sensor; every entry adds one flaw. Quantities are in the unit of the record that the cell is
    used on: N and N m, or EI/L² and EI/L (a rod of 0.1 m and 1e-5 N m² has EI/L² = 1 mN, EI/L = 0.1 mN m). Entries in
    threes are for holding_moment, force_x and force_y.

    Parameters
    ----------
    force_noise, moment_noise : float
        Scale of the white noise ε on each force and on the moment: its standard deviation if it is normal. What a data
        sheet calls noise floor at the sampling rate. A good six-axis cell has some mN and 0.1 mN m; one that suits the
        rod has 0.001 to 0.05 of EI/L² and EI/L. If bands come out too narrow, they are too small.
    degrees_of_freedom : float
        Of Student's t, which ε follows, channel by channel: ∞ is normal; 3 to 10 for knocks and sparks, which give a
        sample in a hundred far out. The scale is then force_noise and moment_noise all the same.
    relative_noise : float
        Noise in proportion to the load, standard deviation (or scale) over reading, added in squares: 0.001 to 0.01 for
        a bridge whose supply is not steady.
    correlation : (float, float, float)
        Coefficients between the noises of moment and force_x, moment and force_y, force_x and force_y: of amplifiers
        and vibrations that are shared, 0 to ± 0.9.
    bias : (float, float, float)
        What is read without load: weight of the rod, some 0.01 of EI/L² of a light one; anything at all where a tare
        was forgotten.
    bias_uncertainty : (float, float, float)
        Standard deviation of what is not known of the bias, constant in a record: it is drawn once for each that is
        measured, and integrated out of the likelihood. After taring on n samples, noise/√n;
        `from_zero_load` finds it.
    drift : RandomWalk or OrnsteinUhlenbeck, optional
        Wandering of the zero from sample to sample, through all sweeps of a record; the two say of what size. One of
        no size is None.
    gain : three rows of (float, float, float)
        Readings (rows) by loads (columns): errors of the calibration on the diagonal, 1 ± 0.005, cross-talk beside it,
        1 to 2 % of full scale. Between moment and force it has units of length.
    lever : (float, float)
        Where the cell takes its moment, from the pivot, along the axes that it measures along [length]: what is beside
        the axle reads a force as a moment. 0.005 of the rod's length where nobody has measured it. Axes that turn are
        those along the rod at the pivot, and across it.
    force_range, moment_range : float
        Largest size of a reading: what is beyond is cut off (with a resolution at the last step in the range). A bridge
        is rated to about twice what is wanted of it.
    force_resolution, moment_resolution : float
        Step of the reading: of a 16 bit converter, range/32768; mostly below the noise.
    drive_angle_offset : float
        What the encoder reads in zero position [rad]; 0.01 (about 0.5°) after aligning by eye.
    drive_angle_backlash : float
        What the encoder reads more while the drive moves forward than while it moves backward [rad], half of it too
        much and half too little: 0.003 (about 0.2°) of a gear; less where the encoder sits on the axle itself.
    drive_angle_noise, drive_angle_resolution : float
        Standard deviation of the encoder's noise [rad], mostly below a step, and its step [rad]: 2π/4096 = 0.0015 for
        one of 1024 lines. The rod follows the true angle, which is in order all the same, and contact ends once.
    frame : {"fixed", "turning"}, optional
        Whether the cell measures forces along the axes of the world, or turns with the drive; all the above is in its
        own frame. By default that of the record that it measures.

    Raises
    ------
    ParameterError
        If an entry is impossible, with what would be possible.

    Examples
    --------
    >>> LoadCell(force_noise=0.05, moment_noise=0.02).standard_deviations["force_y"]
    0.05
    """

    @classmethod
    def from_record(cls, record: xr.Dataset) -> LoadCell | None:
        """The load cell whose data sheet a record carries, in the record's units, or None if it carries none.

        Parameters
        ----------
        record : xr.Dataset
            A record; its attributes that begin with "load_cell_" and are numbers are the data sheet; what they
            leave out is ideal. The frame is the record's.

        Raises
        ------
        ParameterError
            If the data sheet is impossible.

        Examples
        --------
        >>> from tactile_bayes.record import make_record
        >>> columns = {"sweep": 0, "direction": "forward", "drive_angle": [1.2], "holding_moment": [0.5]}
        >>> attrs = {"load_cell_moment_noise": 0.02}
        >>> LoadCell.from_record(make_record(columns, attrs=attrs, missing=("force_x", "force_y"))).moment_noise
        0.02
        """
        entries = stated_entries(validate(record))
        return cls.from_entries(entries) if entries else None

    @classmethod
    def from_zero_load(cls, record: xr.Dataset, *, false_alarm: float = 1e-3) -> LoadCell:
        """The load cell that a record's unloaded stretches tell of: bias, its uncertainty, and white noise.

        Parameters
        ----------
        record : xr.Dataset
            A record with samples before first contact or after snap-off, which need not be labelled; see `zero_load`.
        false_alarm : float
            As in `zero_load`.

        Returns
        -------
        LoadCell
            In the record's units and frame. The noise of the forces is the root mean square of both, or the larger
            where they differ more than noise explains. A missing channel has neither bias nor noise. What else is
            known of the cell can be added with `dataclasses.replace`.

        Raises
        ------
        RecordError
            If fewer than 3 samples are unloaded for certain.
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
        >>> cell = LoadCell.from_zero_load(rig.measure(scan(paper_profile("II", q=0.5)).record, seed=1))
        >>> round(cell.force_noise, 2), round(cell.bias[2], 1)
        (0.05, 0.2)
        """
        return cls(**found_cell(record, false_alarm=false_alarm))

    @property
    def standard_deviations(self) -> Mapping[str, float]:
        """Standard deviation of the white noise on each channel without load, in the order of `CHANNELS`.

        Infinite for Student's t with 2 degrees of freedom and fewer.
        """
        nu = self.degrees_of_freedom
        widening = 1.0 if math.isinf(nu) else math.sqrt(nu / (nu - 2.0)) if nu > 2.0 else math.inf
        return MappingProxyType({name: float(v) * widening for name, v in zip(CHANNELS, self.noise, strict=True)})

    @property
    def approximations(self) -> tuple[str, ...]:
        """In words, where `log_likelihood` is not exact for this load cell; infer_contour notes it in its result.

        Taking the steps of the reading for noise is wrong by little: with an unknown bias as large as the noise, and
        10 samples, steps of 0.5, 1 and 2 standard deviations of the noise change the log-likelihood by 0.00003, 0.0004
        and 0.004 per sample (standard deviation over records; the mean is less), and what it says between two loads one
        standard error apart by 0.0002, 0.003 and 0.03.

        Examples
        --------
        >>> LoadCell(force_noise=0.05, force_resolution=0.05, correlation=(0.0, 0.0, 0.5)).approximations
        ('beside correlated noise, the steps of the reading are taken for white noise of a twelfth of their square',)
        """
        return approximations(self)

    def measure(self, record: xr.Dataset, *, seed: int | np.random.Generator) -> xr.Dataset:
        """The record as this load cell gives it.

        Parameters
        ----------
        record : xr.Dataset
            A record without noise, in the units of the load cell. It is not changed.
        seed : int or np.random.Generator
            Where the random numbers come from: the same seed, the same numbers. A channel has the same white noise
            whether or not others are missing.

        Returns
        -------
        xr.Dataset
            The record with noise, in the frame of the cell. What was there before is kept in columns
            truth_drive_angle (if the encoder is not ideal), truth_holding_moment, truth_force_x and truth_force_y,
            unless the record has them already. The data sheet is kept in attributes that begin with "load_cell_"; of
            white noise that was there before, by the sum of variances.

        Raises
        ------
        RecordError
            If `record` is not a record, or the encoder's errors are such that the result is none.
        ParameterError
            If `seed` is neither a nonnegative integer nor a generator; if there is cross-talk from a channel that is
            missing; if the record has been measured before, by a cell with more than white noise.

        Examples
        --------
        >>> from tactile_bayes.record import make_record
        >>> columns = {"sweep": 0, "direction": "forward", "drive_angle": [1.2], "holding_moment": [0.5]}
        >>> ideal = make_record(columns, missing=("force_x", "force_y"))
        >>> measured = LoadCell(moment_noise=0.02).measure(ideal, seed=1)
        >>> float(measured["truth_holding_moment"][0]), round(float(measured["holding_moment"][0]), 3)
        (0.5, 0.507)
        """
        return measured(self, record, _generator(seed))

    def corrected(self, record: xr.Dataset) -> xr.Dataset:
        """The record with what is known of this cell's errors taken out: bias, gain, lever, offset and backlash.

        For points of contact, sample by sample. A likelihood wants the record as it is: of what has been taken out, the
        ends of the range can no longer be told.

        Parameters
        ----------
        record : xr.Dataset
            A measured record, in the units of the load cell and in its frame.

        Returns
        -------
        xr.Dataset
            The record itself, if there is nothing to take out. Noise, steps and range are no longer what the data
            sheet says where the gain has been taken out.

        Raises
        ------
        ParameterError
            If the frame is another; if there is cross-talk, or a lever, from a channel that the record misses.

        Examples
        --------
        >>> from tactile_bayes import scan
        >>> from tactile_bayes.contours import paper_profile
        >>> cell = LoadCell(bias=(0.1, 0.0, 0.2), drive_angle_offset=0.01)
        >>> ideal = scan(paper_profile("II", q=0.5)).record
        >>> back = cell.corrected(cell.measure(ideal, seed=1))
        >>> float(abs(back.force_y - ideal.force_y).max()) < 1e-15
        True
        """
        self.refuse_other_frame(record)
        return corrected(self, record)

    def refuse_other_frame(self, record: xr.Dataset) -> None:
        """Raise ParameterError if a record is in another frame than this cell measures in."""
        if self.frame is not None and frame_of(record) != self.frame:
            raise ParameterError(
                f"the load cell is {self.frame}, but the record's forces are {frame_of(record)}: give the cell without "
                f"a frame, or in_frame(record, {self.frame!r})"
            )

    def simulate(self, loads: ArrayLike, *, seed: int | np.random.Generator, noise_scale: ArrayLike = 1.0) -> Floats:
        """Readings of loads, as arrays.

        Parameters
        ----------
        loads : array_like, shape (..., samples, 3)
            Channels in the order of `CHANNELS`, in the units and the frame of the load cell.
        seed : int or np.random.Generator
            As in `measure`.
        noise_scale : array_like, broadcastable to shape (..., 3)
            Factor on the white noise of each channel.

        Returns
        -------
        ndarray, shape (..., samples, 3)

        Raises
        ------
        ParameterError
            If the shape of loads, the seed or a factor is impossible.

        Examples
        --------
        >>> LoadCell(force_resolution=0.25, moment_range=1.0).simulate([[2.0, 0.3, 0.1]], seed=1)
        array([[1.  , 0.25, 0.  ]])
        """
        given = np.asarray(loads, dtype=np.float64)
        if given.ndim < 2 or given.shape[-1] != len(CHANNELS):
            raise ParameterError(
                f"loads have the shape {given.shape}: give (..., samples, 3), with the channels {', '.join(CHANNELS)}"
            )
        scale = checked_noise_scale(noise_scale, given.shape)
        batch = np.broadcast_shapes(scale.shape[:-1], given.shape[:-2])
        return corrupted_loads(self, np.broadcast_to(given, (*batch, *given.shape[-2:])), _generator(seed), scale)

    def covariance(self, loads: ArrayLike) -> Floats:
        """Covariance of the errors of readings, each sample looked at by itself: what samples share counts as noise.

        White noise in proportion to the loads too, correlations, drift and what is not known of the bias, and steps
        (as a twelfth of their square).

        Parameters
        ----------
        loads : array_like, shape (n_samples, 3)
            Samples from the first of a record on, since drift may grow. Only noise in proportion to the load asks how
            large they are.

        Returns
        -------
        ndarray, shape (n_samples, 3, 3)
            Infinite for Student's t with 2 degrees of freedom and fewer.

        Examples
        --------
        >>> cell = LoadCell(force_noise=0.03, moment_noise=0.02, bias_uncertainty=(0.0, 0.04, 0.0))
        >>> np.sqrt(np.diagonal(cell.covariance(np.zeros((1, 3)))[0])).round(3)
        array([0.02, 0.05, 0.03])
        """
        return covariance(self, np.asarray(loads, dtype=np.float64))

    @property
    def drive_angle_deviation(self) -> float:
        """Standard deviation of the encoder's error [rad]: noise, and steps as a twelfth of their square."""
        return math.hypot(self.drive_angle_noise, self.drive_angle_resolution / math.sqrt(12.0))

    def surprise(self, readings: ArrayLike) -> Floats:
        """How far readings are from those of no load: a χ² number with as many degrees of freedom as channels.

        Squares in standard deviations, correlations heeded, what steps, drift and an unknown bias can do counted as
        noise; of Student's t the squares of normal numbers that are as rare. It is χ² exactly without steps, and
        without outliers beside drift or an unknown bias. What is exceeded once in 1000 samples then becomes rarer: at
        most by a factor of 3 for steps of up to two standard deviations of the noise, by some 50 for outliers beside a
        bias that is three times the noise.

        Parameters
        ----------
        readings : array_like, shape (n_samples, 3)
            As in `log_likelihood`. A channel without noise, steps or drift must not be present.

        Returns
        -------
        ndarray, shape (n_samples,)

        Examples
        --------
        >>> LoadCell(moment_noise=0.02).surprise([[0.04, np.nan, np.nan]]).round(6)
        array([4.])
        """
        return surprise(self, np.asarray(readings, dtype=np.float64))

    def log_likelihood(
        self, measured: ArrayLike, predicted: ArrayLike, *, noise_scale: ArrayLike = 1.0, pointwise: bool = False
    ) -> Floats:
        """Log-density of what was measured, for one or many predictions; drive angles are taken to be exact.

        Independent normal or Student's t noise is exact, with steps and cut-offs, too: the density of a reading is then
        the probability of its step (of all that is beyond, at the end of the range). So is normal noise that is
        correlated between channels, or has a drift or an unknown bias beside it, whatever wanders being integrated
        out; with steps, `approximations` says what is not. What has no such form is refused.

        Parameters
        ----------
        measured : array, shape (n_samples, 3)
            Channels in the order of `CHANNELS`, in the units of the load cell, samples in the order in which they were
            taken. A missing channel is NaN throughout.
        predicted : array, shape (..., n_samples, 3)
            What an ideal sensor would have given, in the same frame. Missing channels are ignored, unless they have
            cross-talk on others; NaN elsewhere gives NaN.
        noise_scale : array, broadcastable to shape (..., 3)
            Factor on the white noise of each channel, positive; for a cell that is noisier than its data sheet. It
            does not apply to drift and bias_uncertainty.
        pointwise : bool
            Whether to keep the samples apart instead of summing over them; where samples know of one another, each is
            given those before it.

        Returns
        -------
        array, shape (...) or (..., n_samples)
            Normalised log-likelihood; 0 where every channel is missing.

        Raises
        ------
        ParameterError
            If a present channel has no noise, or misses some of its samples; if a reading is beyond the range, a noise
            scale is not positive, or the shapes do not fit; if drift, an unknown bias or correlation come together with
            outliers, or with a sample at the end of the range, or three of drift, unknown bias, correlation and
            relative_noise.

        Examples
        --------
        >>> cell = LoadCell(force_noise=0.05, moment_noise=0.02)
        >>> moment_only = [[0.51, np.nan, np.nan]]
        >>> cell.log_likelihood(moment_only, [[[0.5, 0.0, 0.0]], [[0.51, 0.0, 0.0]]]).round(4)
        array([2.8681, 2.9931])
        """
        return log_likelihood(self, measured, predicted, noise_scale, pointwise)

    def log_density_left_out(
        self, measured: ArrayLike, predicted: ArrayLike, *, noise_scale: ArrayLike = 1.0
    ) -> Floats:
        """Log-density of each sample given all the others: what leave-one-out cross-validation asks for.

        The channels of a sample are taken together. Independent samples know nothing of one another, and this is the
        pointwise `log_likelihood`; of drift and an unknown bias the samples before and after tell, exactly.

        Parameters
        ----------
        measured : array, shape (n_samples, 3)
            As in `log_likelihood`.
        predicted : array, shape (..., n_samples, 3)
            As in `log_likelihood`.
        noise_scale : array, broadcastable to shape (..., 3)
            As in `log_likelihood`.

        Returns
        -------
        array, shape (..., n_samples)
            Normalised; 0 where every channel is missing. They do not sum to the log-likelihood where samples know of
            one another.

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
        return log_density_left_out(self, measured, predicted, noise_scale)


def _generator(seed: int | np.random.Generator) -> np.random.Generator:
    if isinstance(seed, np.random.Generator):
        return seed
    return np.random.default_rng(check_seed(seed, "give a nonnegative integer or a numpy.random.Generator"))
