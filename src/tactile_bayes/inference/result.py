"""Results of inference: provenance, groups, files, and the form of the installed ArviZ."""

from __future__ import annotations

import json
import os
import platform
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import cache
from importlib.metadata import version
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.checks import check_kind, check_path
from tactile_bayes.contours.families import family_named
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.ensembles import Draws, SamplerSettings
from tactile_bayes.numerics.random_numbers import Seed, seed_words
from tactile_bayes.record.netcdf import RESULT_FORMAT, read_netcdf, write_netcdf
from tactile_bayes.tasks.documents import read_json

STREAMED = "sequential Monte Carlo"  # sampler of a stream, as the attribute of its posterior states it
OTHER = "another sampler"  # as the attribute of a result of its draws begins
# Libraries by which a posterior is computed and stored, besides Python.
_SOFTWARE = ("tactile-bayes", "numpy", "scipy", "emcee", "numba", "xarray", "arviz-stats", "h5netcdf")
_EVENTS = ("first_contact_x", "snap_off_contact_x", "snap_off_drive_angle")
_NO_CONTOUR = "expected the DataTree from infer_contour, or from read_result"


def sample_stats(draws: Draws) -> xr.Dataset:
    """Return the group `sample_stats`: log-probability of every draw, and diagnostics of the ensembles."""
    chains, count = draws.log_probability.shape
    return xr.Dataset(
        {
            "lp": (("chain", "draw"), draws.log_probability),
            "acceptance_rate": ("chain", draws.acceptance),
            "r_hat": ("parameter", draws.r_hat),
            "ess_bulk": ("parameter", draws.ess_bulk),
            "ess_tail": ("parameter", draws.ess_tail),
            "autocorrelation_time": ("parameter", draws.autocorrelation_time),
        },
        coords={"chain": np.arange(chains), "draw": np.arange(count), "parameter": list(draws.names)},
        attrs={
            "walkers": draws.walkers,
            "steps_run": draws.steps_run,
            "steps_kept": draws.steps_kept,
            "every": draws.every,
            "evaluations": draws.evaluations,
            "seconds": draws.seconds,
            "stuck": draws.stuck,
            "places": json.dumps([asdict(mode) for mode in draws.modes]),
        },
    )


def provenance(draws: Draws, *, seed: Seed, settings: SamplerSettings, data_sha256: str, **more: Any) -> dict[str, Any]:
    """Return attributes of a result: software, seed, settings, hash of the data, convergence and message."""
    return {
        **library(),
        "sampler": f"emcee {version('emcee')}",
        "versions": _versions(),
        "seed": seed_words(seed),
        "settings": json.dumps(asdict(settings)),
        "data_sha256": data_sha256,
        "converged": int(draws.converged),
        "message": draws.message,
        **more,
    }


def library() -> dict[str, Any]:
    """Return the attributes of a result that state by which software it is, and its format."""
    return {
        "inference_library": "tactile-bayes",
        "inference_library_version": version("tactile-bayes"),
        **RESULT_FORMAT,
    }


def is_streamed(attrs: Mapping[Any, Any]) -> bool:
    """Return whether the posterior with these attributes is that of a stream."""
    return bool(attrs.get("sampler") == STREAMED)


@cache
def _versions() -> str:
    return json.dumps({"Python": platform.python_version(), **{name: version(name) for name in _SOFTWARE}})


def posterior_draws(result: xr.DataTree | xr.Dataset) -> xr.Dataset:
    """Return the posterior group of a result, or the dataset if it is one already."""
    draws = result if isinstance(result, xr.Dataset) else _posterior_group(result)
    for name, values in draws.data_vars.items():
        if set(values.dims) == {"chain", "draw"} and values.dtype.kind == "f":
            refuse_not_finite(f"{name} in the posterior", values)
    return draws


def best_draw(result: xr.DataTree) -> xr.Dataset:
    """Return the most probable draw, which the rod can reach; the medians may be out of reach."""
    return posterior_draws(result).isel(result["sample_stats"]["lp"].argmax(("chain", "draw")))


def _posterior_group(result: xr.DataTree) -> xr.Dataset:
    if "posterior" not in result.children:
        raise InferenceError(f"this tree has no group 'posterior', only {', '.join(result.children) or 'nothing'}")
    return result["posterior"].to_dataset()


def refuse_not_finite(what: str, values: xr.DataArray) -> None:
    """Refuse draws that are not finite numbers, and name the first of them."""
    bad = ~np.isfinite(values.values)
    if bad.any():
        first = np.argwhere(bad)[0]
        labels = (
            values[dim].values[i] if dim in values.coords else i for dim, i in zip(values.dims, first, strict=True)
        )
        at = ", ".join(f"{dim} {label}" for dim, label in zip(values.dims, labels, strict=True))
        raise InferenceError(
            f"{int(bad.sum())} of {bad.size} draws of {what} are not finite numbers, the first at {at}: infer it again"
        )


def record_of(posterior: xr.DataTree) -> xr.Dataset:
    """Return the record from which a contour was inferred, with the rod and the load cell of the inference."""
    refuse_no_contour(posterior, "constant_data", "observed_data")
    if "units" not in posterior.attrs:
        raise InferenceError(_NO_CONTOUR)
    kept = {
        name: value
        for name, value in posterior.attrs.items()
        if str(name).startswith(("rod_", "load_cell_", "contact_sides", "blocks"))
    }
    columns = [posterior[group].to_dataset() for group in ("constant_data", "observed_data")]
    return xr.merge(columns).assign_attrs({"units": posterior.attrs["units"], **kept})


def contact_draws(result: xr.DataTree | xr.Dataset) -> xr.Dataset:
    """Return the posterior group of a result of `infer_contacts`."""
    is_xarray = isinstance(result, xr.DataTree | xr.Dataset)
    draws = posterior_draws(result) if is_xarray else xr.Dataset()
    if not {"chain", "draw", "sample"} <= set(draws.dims) or "contact_x" not in draws:
        raise InferenceError("this is no result of infer_contacts: give what it returned, or its group 'posterior'")
    return draws


def contour_draws(result: xr.DataTree) -> xr.Dataset:
    """Return the posterior group of a result of `infer_contour`."""
    refuse_no_contour(result, "posterior")
    if not {"family", "units"} <= set(result.attrs):
        raise InferenceError(_NO_CONTOUR)
    draws = posterior_draws(result)
    _refuse_absent(draws, family_named(result.attrs["family"]).parameters, ("chain", "draw"))
    return draws


def contour_events(result: xr.DataTree) -> xr.Dataset:
    """Return the group of first contacts and snap-offs of a result of `infer_contour`."""
    refuse_no_contour(result, "events")
    events = result["events"].to_dataset()
    _refuse_absent(events, _EVENTS, ("chain", "draw", "segment"))
    return events


def refuse_no_contour(result: Any, *groups: str) -> None:
    """Refuse an object that is no result of `infer_contour` with these groups."""
    if not (isinstance(result, xr.DataTree) and set(groups) <= set(result.children)):
        raise InferenceError(_NO_CONTOUR)


def _refuse_absent(group: xr.Dataset, names: Sequence[str], dims: Sequence[str]) -> None:
    """Refuse a group without numeric variables of these names and dimensions."""
    for name in names:
        if name not in group or not set(dims) <= set(group[name].dims) or group[name].dtype.kind not in "iuf":
            raise InferenceError(f"{_NO_CONTOUR} (it has no numbers {name!r} by {', '.join(dims)})")
        if not group[name].size:
            raise InferenceError(f"this posterior has no draws of {name!r}: infer it again")


def write_result(result: xr.DataTree, path: str | os.PathLike[str]) -> None:
    """Write a posterior to a NetCDF file, whole or not at all.

    Parameters
    ----------
    result : xr.DataTree
        Result of `infer_contour`, `infer_contacts` or `infer_point_load`.
    path : path-like
        Path of the file, with suffix .nc.

    Raises
    ------
    InferenceError
        If the suffix is another, or the object is no posterior.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> draws = xr.Dataset({"q": (("chain", "draw"), np.full((4, 100), 0.5))})
    >>> with tempfile.TemporaryDirectory() as directory:
    ...     path = Path(directory) / "posterior.nc"
    ...     write_result(xr.DataTree.from_dict({"posterior": draws}), path)
    ...     read_result(path)["posterior"].sizes["draw"]
    100
    """
    path = check_path("path", path, "give the path of a file, like 'posterior.nc'")
    if path.suffix != ".nc":
        raise InferenceError(f"{path}: a result is written as NetCDF, give a name that ends in .nc")
    if not isinstance(result, xr.DataTree):
        raise InferenceError("this is no result: give the tree that infer_contour or infer_contacts has returned")
    _posterior_group(result)
    write_netcdf(result, path)


def read_result(path: str | os.PathLike[str]) -> xr.DataTree:
    """Read a posterior from a file of `write_result`.

    Parameters
    ----------
    path : path-like
        Path of the file.

    Returns
    -------
    xr.DataTree
        The posterior, as it was written.

    Raises
    ------
    InferenceError
        If there is no such file, or it holds no posterior or is damaged.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> draws = xr.Dataset({"q": (("chain", "draw"), np.full((4, 100), 0.5))})
    >>> with tempfile.TemporaryDirectory() as directory:
    ...     write_result(xr.DataTree.from_dict({"posterior": draws}), Path(directory) / "posterior.nc")
    ...     float(read_result(Path(directory) / "posterior.nc")["posterior"]["q"].mean())
    0.5
    """
    path = check_path("path", path)
    try:
        result = read_netcdf(path, xr.open_datatree, lambda what: InferenceError(f"{path} {what}: infer again"))
    except FileNotFoundError:
        raise InferenceError(f"there is no file {path}: give that of a result") from None
    except OSError as error:
        raise InferenceError(f"{path} cannot be opened ({error.strerror}): give the file of a posterior") from error
    _posterior_group(result)
    return result


def to_arviz(posterior: xr.DataTree) -> Any:
    """Return a result in the form that the installed ArviZ accepts.

    Parameters
    ----------
    posterior : xr.DataTree
        A result of this package.

    Returns
    -------
    arviz.InferenceData or xr.DataTree
        The former for ArviZ 0.23, the latter from 1.0 on. Of a contour, every group has the same draws, those of which
        predictions are stored, and `observed_data`, `posterior_predictive` and `log_likelihood` have one variable
        `record` over row and channel, whose units are an attribute: to ArviZ, a sample is a draw. R̂ and effective
        sample sizes of all draws are those of ``result["posterior"].to_dataset()``, which ArviZ accepts, too.

    Raises
    ------
    ParameterError
        If the object is no tree.
    InferenceError
        If a draw of the posterior is not a finite number.

    Examples
    --------
    >>> draws = xr.Dataset({"q": (("chain", "draw"), np.full((4, 100), 0.5))})
    >>> float(to_arviz(xr.DataTree.from_dict({"posterior": draws})).posterior["q"].mean())
    0.5
    """
    check_kind("posterior", posterior, xr.DataTree, "give a result of infer_contour or infer_contacts")
    if "posterior" in posterior.children:
        posterior_draws(posterior)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # ArviZ 0.23 warns of its refactoring
        import arviz

    whole = xr.DataTree.from_dict(_by_reading({n: group.to_dataset() for n, group in posterior.children.items()}))
    whole.attrs = posterior.attrs
    if int(arviz.__version__.split(".")[0]) >= 1:  # not by hasattr: it has names of former versions, too
        return whole
    return arviz.from_datatree(whole)


def _by_reading(groups: dict[str, xr.Dataset]) -> dict[str, xr.Dataset]:
    """Return groups at the draws with a log-likelihood by channel, if there are any, and readings in its layout."""
    by_reading = groups.get("log_likelihood", xr.Dataset())
    if "channel" not in by_reading.dims:
        return groups
    channels = by_reading["channel"].values.tolist()
    for name in ("posterior", "sample_stats", "log_prior"):
        groups[name] = groups[name].sel(draw=by_reading["draw"])
    for name in ("observed_data", "posterior_predictive"):
        readings = groups[name][channels]
        units = [readings[channel].attrs["units"] for channel in channels]
        record = readings.to_dataarray("channel", "record").transpose(..., "channel")
        groups[name] = record.assign_attrs(units=", ".join(units)).to_dataset()
    return {n: group.rename(sample="row") if "sample" in group.dims else group for n, group in groups.items()}


def known_of(attrs: Mapping[Any, Any]) -> dict[str, float]:
    """Return the known parameters that attributes state: of the contour, and of the rig if not as stated."""
    if "known" not in attrs:
        raise InferenceError("the posterior does not state what was known: infer it again")
    known: dict[str, float] = read_json(attrs["known"], "known")
    return known
