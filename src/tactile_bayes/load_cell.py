"""The load cell: what a sensor does to a record, and how likely what it measured is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from tactile_bayes.errors import ParameterError
from tactile_bayes.record import CHANNELS, column_of, frame_of, present_channels, validate
from tactile_bayes.rod import Rod

__all__ = ["LoadCell", "rough_noise"]


@dataclass(frozen=True)
class LoadCell:
    """A load cell under the pivot, with white Gaussian noise on each channel.

    It measures y = h + ε, where h is holding moment and support reaction, and the ε of every sample and channel
    are independent and normal.

    Parameters
    ----------
    force_noise : float
        Standard deviation of the noise on force_x and force_y, in the unit of the record that the cell is used
        on [N, or EI/L²]; the same in either frame. What a data sheet calls force resolution or noise floor at the
        sampling rate; a good six-axis cell has some mN, where a rod of 0.1 m and 1e-5 N m² has EI/L² = 1 mN, so soft
        rods need cells for µN. If bands come out too narrow, it is too small. Default 0, an ideal sensor.
    moment_noise : float
        Standard deviation of the noise on the holding moment [N m, or EI/L]. Typically 0.001 to 0.05 of EI/L for a
        cell that suits the rod. Default 0.

    Raises
    ------
    ParameterError
        If a standard deviation is negative or not finite.

    Examples
    --------
    >>> LoadCell(force_noise=0.05, moment_noise=0.02).standard_deviations["force_y"]
    0.05
    """

    force_noise: float = 0.0
    moment_noise: float = 0.0

    def __post_init__(self) -> None:
        for name, unit in (("force_noise", "N"), ("moment_noise", "N m")):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise ParameterError(
                    f"the load cell's {name} is {value!r}: give a standard deviation, zero or positive [{unit}, or "
                    "dimensionless]"
                )

    @classmethod
    def from_record(cls, record: xr.Dataset) -> LoadCell | None:
        """The load cell whose data sheet a record carries, in the record's units, or None if it carries none.

        Parameters
        ----------
        record : xr.Dataset
            A record; its attributes `load_cell_force_noise` and `load_cell_moment_noise` are the data sheet. Where
            one of the two is absent, it is 0 here.

        Raises
        ------
        ParameterError
            If the data sheet is impossible.

        Examples
        --------
        >>> from tactile_bayes.record import make_record
        >>> columns = {"sweep": 0, "direction": "forward", "drive_angle": [1.2], "holding_moment": [0.5]}
        >>> attrs = {"load_cell_moment_noise": 0.02}
        >>> LoadCell.from_record(make_record(columns, attrs=attrs, missing=("force_x", "force_y")))
        LoadCell(force_noise=0.0, moment_noise=0.02)
        """
        stated = {
            name: float(record.attrs[f"load_cell_{name}"])
            for name in ("force_noise", "moment_noise")
            if f"load_cell_{name}" in record.attrs
        }
        return cls(**stated) if stated else None

    @property
    def standard_deviations(self) -> Mapping[str, float]:
        """Standard deviation of the noise on each channel, in the order of `CHANNELS`."""
        return MappingProxyType(
            {"holding_moment": self.moment_noise, "force_x": self.force_noise, "force_y": self.force_noise}
        )

    def dimensionless(self, rod: Rod) -> LoadCell:
        """The same load cell in the units of a rod: forces in EI/L², moments in EI/L.

        Parameters
        ----------
        rod : Rod
            The rod that the cell is used with.

        Examples
        --------
        >>> LoadCell(force_noise=0.5, moment_noise=0.25).dimensionless(Rod(length=0.5, flexural_rigidity=2.0))
        LoadCell(force_noise=0.0625, moment_noise=0.0625)
        """
        return LoadCell(self.force_noise / rod.force_unit, self.moment_noise / rod.moment_unit)

    def measure(self, record: xr.Dataset, *, seed: int | np.random.Generator) -> xr.Dataset:
        """The record as this load cell gives it: with noise on every channel that is present.

        For a load cell that turns with the drive, give the record in that frame: `in_frame(record, "turning")`.

        Parameters
        ----------
        record : xr.Dataset
            A record, in the units of the load cell. It is not changed.
        seed : int or np.random.Generator
            Where the random numbers come from: the same seed, the same noise. A channel has the same noise
            whether or not others are missing.

        Returns
        -------
        xr.Dataset
            The record with noise. What was there before is kept in columns truth_holding_moment, truth_force_x
            and truth_force_y, unless the record has them already. The data sheet is kept in the attributes
            load_cell_force_noise and load_cell_moment_noise; if there was noise before, by the sum of variances.

        Raises
        ------
        RecordError
            If `record` is not a record.
        ParameterError
            If `seed` is neither a nonnegative integer nor a generator.

        Examples
        --------
        >>> from tactile_bayes.record import make_record
        >>> columns = {"sweep": 0, "direction": "forward", "drive_angle": [1.2], "holding_moment": [0.5]}
        >>> ideal = make_record(columns, missing=("force_x", "force_y"))
        >>> measured = LoadCell(moment_noise=0.02).measure(ideal, seed=1)
        >>> float(measured["truth_holding_moment"][0]), round(float(measured["holding_moment"][0]), 3)
        (0.5, 0.507)
        """
        measured = validate(record)
        noise = _generator(seed).standard_normal((measured.sizes["sample"], len(CHANNELS)))
        for index, channel in enumerate(CHANNELS):
            if channel not in present_channels(measured):
                continue
            ideal = measured[channel]
            truth = column_of(f"truth_{channel}")
            if truth is not None and truth.name not in measured:
                attrs = {"units": ideal.attrs["units"], "long_name": truth.long_name_in(frame_of(measured))}
                measured[truth.name] = ("sample", ideal.values.copy(), attrs)
            noisy = ideal.values + self.standard_deviations[channel] * noise[:, index]
            measured[channel] = ("sample", noisy, ideal.attrs)
        before = LoadCell.from_record(measured) or LoadCell()
        measured.attrs["load_cell_force_noise"] = math.hypot(before.force_noise, self.force_noise)
        measured.attrs["load_cell_moment_noise"] = math.hypot(before.moment_noise, self.moment_noise)
        return measured

    def log_likelihood(
        self, measured: ArrayLike, predicted: ArrayLike, *, noise_scale: ArrayLike = 1.0, pointwise: bool = False
    ) -> NDArray[np.float64]:
        """Log-density of what was measured, for one or many predictions.

        Σ log N(measured | predicted, (noise_scale · standard deviation)²), over samples and present channels.

        Parameters
        ----------
        measured : array, shape (n_samples, 3)
            Channels in the order of `CHANNELS`, in the units of the load cell. A missing channel is NaN throughout.
        predicted : array, shape (..., n_samples, 3)
            What an ideal sensor would have given, in the same frame. Missing channels are ignored; NaN elsewhere gives
            NaN.
        noise_scale : array, broadcastable to shape (..., 3)
            Factor on the standard deviation of each channel, positive; for a cell that is noisier than its data sheet.
        pointwise : bool
            Whether to keep the samples apart instead of summing over them.

        Returns
        -------
        array, shape (...) or (..., n_samples)
            Normalised log-likelihood; 0 where every channel is missing.

        Raises
        ------
        ParameterError
            If a present channel has no noise, or misses some of its samples; if a noise scale is not positive; if
            the shapes do not fit.

        Examples
        --------
        >>> cell = LoadCell(force_noise=0.05, moment_noise=0.02)
        >>> moment_only = [[0.51, np.nan, np.nan]]
        >>> cell.log_likelihood(moment_only, [[[0.5, 0.0, 0.0]], [[0.51, 0.0, 0.0]]]).round(4)
        array([2.8681, 2.9931])
        """
        measured = np.asarray(measured, dtype=np.float64)
        predicted = np.asarray(predicted, dtype=np.float64)
        if measured.shape[1:] != (len(CHANNELS),) or predicted.shape[-2:] != measured.shape:
            raise ParameterError(
                f"measured has shape {measured.shape} and predicted {predicted.shape}: give (n_samples, 3) and "
                f"(..., n_samples, 3), with the channels {', '.join(CHANNELS)}"
            )
        scale = np.asarray(noise_scale, dtype=np.float64)
        if not (scale > 0).all():
            raise ParameterError(f"a noise_scale is {float(np.min(scale))!r}: give positive factors")
        try:
            np.broadcast_shapes(scale.shape, (*predicted.shape[:-2], len(CHANNELS)))
        except ValueError:
            raise ParameterError(
                f"noise_scale has shape {scale.shape} and predicted {predicted.shape}: give factors that broadcast to "
                f"{(*predicted.shape[:-2], len(CHANNELS))}, the last axis for the channels {', '.join(CHANNELS)}"
            ) from None
        present = self._present(measured)
        deviations = np.array([self.standard_deviations[CHANNELS[index]] for index in present])
        deviations = deviations * np.broadcast_to(scale, (*scale.shape[:-1], len(CHANNELS)))[..., present]
        if present.size < len(CHANNELS):
            measured, predicted = measured[:, present], np.take(predicted, present, axis=-1)
        # Samples and channels as one axis, and a product for the sum: an axis of three is several times slower.
        squares = predicted.reshape(*predicted.shape[:-2], measured.size) - measured.ravel()
        squares *= squares
        squares = squares.reshape(predicted.shape)
        weight = -0.5 / deviations**2
        offset = -(np.log(deviations) + 0.5 * math.log(2 * math.pi)).sum(axis=-1)
        if pointwise:
            return np.asarray((squares @ weight[..., None])[..., 0] + offset[..., None])
        return np.asarray((np.ones(measured.shape[0]) @ squares * weight).sum(-1) + measured.shape[0] * offset)

    def _present(self, measured: NDArray[np.float64]) -> NDArray[np.intp]:
        """Indices of the channels that are not missing."""
        absent = np.isnan(measured)
        present = np.flatnonzero(~absent.all(axis=0))
        for index in present:
            name = CHANNELS[index]
            if absent[:, index].any():
                raise ParameterError(
                    f"measured misses sample {int(np.argmax(absent[:, index]))} of {name}, but has others: remove the "
                    "sample, or set the whole channel to NaN"
                )
            if self.standard_deviations[name] == 0:
                source = "moment_noise" if name == "holding_moment" else "force_noise"
                raise ParameterError(
                    f"{name} is measured, but the load cell has no noise on it: give LoadCell({source}=...) a positive "
                    "standard deviation"
                )
        return present


def rough_noise(signal: NDArray[np.float64]) -> float:
    """Standard deviation of the white noise on a smooth signal, from its median second difference; 0 of two samples.

    Second differences take away what is straight, and the median what jumps; of normal noise they have √6 times its
    standard deviation, which is 1.4826 times the median of their size.

    Parameters
    ----------
    signal : array, shape (n_samples,)
        In the order of measurement.

    Examples
    --------
    >>> ramp, noise = np.linspace(0.0, 1.0, 20_000), np.random.default_rng(1).normal(size=20_000)
    >>> round(rough_noise(ramp + 0.02 * noise), 3)
    0.02
    """
    bends = np.diff(signal, n=2)
    return 1.4826 * float(np.median(np.abs(bends))) / math.sqrt(6.0) if bends.size else 0.0


def _generator(seed: int | np.random.Generator) -> np.random.Generator:
    if isinstance(seed, np.random.Generator):
        return seed
    if not isinstance(seed, int | np.integer) or seed < 0:
        raise ParameterError(f"seed={seed!r}: give a nonnegative integer or a numpy.random.Generator")
    return np.random.default_rng(seed)
