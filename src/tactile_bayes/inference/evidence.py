"""The evidence of a family of contours, and the integral of any density from draws, by bridge sampling."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.special import expit, log_expit, ndtr

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.contour import Sampled
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.coordinates import in_coordinates
from tactile_bayes.inference.densities import Proposal, effective_number, normalised, weighed
from tactile_bayes.inference.parameters.priors import widened

_KNOTS = np.linspace(-2.0, 2.0, 7)  # of normal scores: more would follow noise, fewer would not resolve hard bounds
_PROPOSALS = 4000  # for a standard error of 0.01 to 0.04
_MOST_DRAWS = 50_000  # that are used, evenly spaced: more than ten times the proposals add little
_LEAST_PER_CHAIN = 8  # draws that ArviZ needs for an effective sample size
_LEAST_PER_PARAMETER = 5  # draws in a half, for an estimate of the covariance
_FLAT = 1e-13  # smallest over largest variance of standardised parameters below which the variance is due to rounding
_LEAST_TERMS = 5.0  # effective number of draws, and of proposals, for an estimate
_ROUNDS = 2  # for the effective number of draws, which hardly depends on the threshold, and vice versa


class Evidence(NamedTuple):
    """The logarithm of an integral, with its standard error and overlap."""

    log_evidence: Any  # a number, or, of a contour, an array with one for each of `WIDTHS`
    standard_error: float  # of `log_evidence`
    # ∫ p q/(s p + (1 − s) q) of the density p and the proposal density q, both normalised, with s the share of draws of
    # p: 1 if both are the same, 0 if they are disjoint. Below some 0.1, the standard error is not reliable.
    overlap: float


def bridge_evidence(
    log_density: Callable[[Floats], Floats],
    draws: Floats,
    log_densities: Floats,
    rng: np.random.Generator,
    *,
    proposals: int = _PROPOSALS,
) -> Evidence:
    """Return the logarithm of the integral Z of a density f, from draws (chains, n, d), walker-major, and their values.

    For n effective draws of f/Z and m of a density q that is fitted to the other half of the chains (a comparison with
    the fitted draws is biased: Overstall & Forster 2010, doi 10.1016/j.csda.2010.03.008), Z = E_q[f h]/E_p[q h], h =
    1/(s f/Z + (1 − s) q), s = n/(n + m) (Meng & Wong 1996, Statistica Sinica 6, 831). The error has both terms of
    Frühwirth-Schnatter (2004, doi 10.1111/j.1368-423X.2004.00125.x); in tens of dimensions it is up to a quarter too
    large. Neither t distributions nor Warp-III gained anything.
    """
    count = proposals // 2
    _refuse_few(draws)
    thinned = slice(None, None, -(-log_densities.size // _MOST_DRAWS))
    draws, log_densities = draws[:, thinned], log_densities[:, thinned]
    cut, size = len(draws) // 2, draws.shape[-1]
    halves = slice(None, cut), slice(cut, None)
    fits = [_fitted(draws[half].reshape(-1, size)) for half in halves]
    proposed = [fit.draw(rng, count) for fit in fits]
    values = log_density(np.concatenate(proposed))
    ratios = [log_densities - fit.log_density(draws.reshape(-1, size)).reshape(log_densities.shape) for fit in fits]
    first, second = (
        _bridge(ratios[k][halves[1 - k]], values[k * count :][:count] - fits[k].log_density(proposed[k]))
        for k in (0, 1)
    )
    terms = expit(first.threshold - ratios[0]), expit(second.threshold - ratios[1])
    shared = np.sqrt(first.of_draws * second.of_draws) * (1.0 - _correlation(terms, halves))
    variance = first.of_draws + second.of_draws + 2.0 * shared + first.of_proposals + second.of_proposals
    return Evidence(
        0.5 * (first.log_evidence + second.log_evidence),
        0.5 * float(np.sqrt(variance)),
        0.5 * (first.overlap + second.overlap),
    )


def _fitted(points: Floats) -> _ScoreFit:
    """Return the fit to points, (n, d), along parameters, which resolves bounds, or uncorrelated axes: the likelier."""
    deviation = points.std(axis=0)
    same = np.flatnonzero(deviation <= 0.0)
    if same.size:
        raise InferenceError(f"parameter {same[0]} is the same in a half of the draws: give draws that vary")
    sizes, directions = np.linalg.eigh(np.atleast_2d(np.cov((points / deviation).T)))
    try:
        if not sizes[0] > _FLAT * sizes[-1]:
            raise np.linalg.LinAlgError
        uncorrelated = directions / np.sqrt(sizes) @ directions.T / deviation[:, None]
        fits = [_ScoreFit(points, axes) for axes in (np.diag(1.0 / deviation), uncorrelated)]
    except np.linalg.LinAlgError:
        raise InferenceError(
            "a half of the draws lies in a plane: give more draws, or fewer parameters if one follows from others"
        ) from None
    return max(fits, key=lambda fit: fit.log_density(points).mean())


class _ScoreFit:
    """A normal distribution, fitted to points, (n, d), of their normal scores along the columns of `axes`, (d, d).
    Scores are piecewise linear in the place along an axis, for hard bounds and skewness."""

    def __init__(self, points: Floats, axes: Floats) -> None:
        self._centre, self._axes, self._back = points.mean(axis=0), axes, np.linalg.inv(axes)
        self._knots = np.quantile(self._along(points), ndtr(_KNOTS), axis=0).T
        if not np.all(np.diff(self._knots, axis=1) > 0.0):
            raise InferenceError("a half of the draws has too few different points: give more draws")
        self._slopes = (_KNOTS[1] - _KNOTS[0]) / np.diff(self._knots, axis=1)
        scores, _ = self._scores(points)
        root = np.linalg.cholesky(np.atleast_2d(np.cov(scores.T)))
        self._normal = Proposal(scores.mean(axis=0), np.asarray(root), freedom=np.inf)
        self._constant = self._normal.constant + float(np.linalg.slogdet(axes).logabsdet)

    def _along(self, points: Floats) -> Floats:
        return np.asarray((points - self._centre) @ self._axes)

    def draw(self, rng: np.random.Generator, count: int) -> Floats:
        """Draw points, shape (count, d)."""
        scores = self._normal.draw_unbounded(rng, count)
        along = np.empty_like(scores)
        for j, (knots, slopes) in enumerate(zip(self._knots, self._slopes, strict=True)):
            i = _piece(_KNOTS, scores[:, j])
            along[:, j] = knots[i] + (scores[:, j] - _KNOTS[i]) / slopes[i]
        return np.asarray(self._centre + along @ self._back)

    def log_density(self, points: Floats) -> Floats:
        """Return the log-density at points, shape (n, d), as an array of shape (n,)."""
        scores, log_growth = self._scores(points)
        return np.asarray(self._normal.log_density(scores) + log_growth + self._constant)

    def _scores(self, points: Floats) -> tuple[Floats, Floats]:
        """Return normal scores, shape (n, d), and the logarithm of their Jacobian determinant, shape (n,)."""
        along, log_growth = self._along(points), np.zeros(len(points))
        scores = np.empty_like(along)
        for j, (knots, slopes) in enumerate(zip(self._knots, self._slopes, strict=True)):
            i = _piece(knots, along[:, j])
            scores[:, j] = _KNOTS[i] + slopes[i] * (along[:, j] - knots[i])
            log_growth += np.log(slopes)[i]
        return scores, log_growth


def _piece(knots: Floats, values: Floats) -> Index:
    """Return the index of the piece between knots that contains each value; the outer pieces are unbounded."""
    return np.asarray(np.clip(np.searchsorted(knots, values) - 1, 0, knots.size - 2))


class _Bridge(NamedTuple):
    """Bridge estimate of one fit and the draws of the other half."""

    log_evidence: float
    threshold: float  # value of log f − log q at which draw and proposal are equally likely
    of_draws: float  # variance due to the draws
    of_proposals: float  # variance due to the proposals
    overlap: float


def _bridge(drawn: Floats, proposed: Floats) -> _Bridge:
    """Return the bridge estimate from log f − log q at draws of f, shape (chains, n), and of q, shape (m,). At the
    threshold log Z + log(m/n) both sums are equal (Bennett 1976, doi 10.1016/0021-9991(76)90078-4)."""
    if not np.any(np.isfinite(proposed)):
        raise InferenceError(
            "density and fit do not overlap: the density is zero at all proposals; its walls may leave little of the "
            "box around the draws"
        )
    from arviz_stats.base.array import array_stats  # loads Matplotlib

    effective = float(drawn.size)
    for _ in range(_ROUNDS):
        threshold = _threshold(drawn, proposed, effective)
        from_draws, from_proposals = expit(threshold - drawn), expit(proposed - threshold)
        logs = log_expit(threshold - drawn.ravel()), log_expit(proposed - threshold)
        if min(float(effective_number(normalised(each))) for each in logs) < _LEAST_TERMS:
            raise InferenceError(
                "density and fit do not overlap: few points dominate it; do all chains sample the same place?"
            )
        ess: float = array_stats.ess(from_draws, chain_axis=0, draw_axis=1, method="mean")
        used, effective = effective, float(min(ess, drawn.size))
    return _Bridge(
        threshold + float(np.log(used / proposed.size)),
        threshold,
        float(from_draws.var() / from_draws.mean() ** 2 / effective),
        float(from_proposals.var() / from_proposals.mean() ** 2 / proposed.size),
        float(from_draws.mean() * (1.0 + used / proposed.size)),
    )


def _threshold(drawn: Floats, proposed: Floats, effective: float) -> float:
    """Return the threshold at which both sums are equal."""

    def difference(threshold: float) -> float:
        return float(effective * expit(threshold - drawn).mean() - proposed.size * expit(proposed - threshold).mean())

    finite = np.append(drawn, proposed[np.isfinite(proposed)])
    margin = 5.0 + np.log(drawn.size) + np.log(proposed.size)
    return float(brentq(difference, finite.min() - margin, finite.max() + margin, maxiter=1000))


def _correlation(both: tuple[Floats, Floats], halves: tuple[slice, slice]) -> float:
    """Return the correlation of two terms of the same draws, shape (chains, n), within halves; 0 if negative."""
    a, b = (np.concatenate([(terms[half] - terms[half].mean()).ravel() for half in halves]) for terms in both)
    scale = np.linalg.norm(a) * np.linalg.norm(b)
    return float(np.clip(a @ b / scale, 0.0, 1.0)) if scale > 0.0 else 0.0


def _refuse_few(draws: Floats) -> None:
    """Refuse fewer chains or draws, shape (chains, n, d), than two fits and effective sample sizes need."""
    chains, each, size = draws.shape
    least = max(_LEAST_PER_CHAIN, -(-_LEAST_PER_PARAMETER * size // max(chains // 2, 1)))
    if chains < 2 or each < least:
        raise InferenceError(
            f"{chains} chains of {each} draws of {size} parameters: give at least 2 chains, and of {max(chains, 2)} "
            f"chains at least {least} draws each, many more if they are correlated"
        )


WIDTHS = (0.5, 1.0, 2.0)  # factors on the widths of the priors of sizes, exponents, amplitude and length scale
_POSTERIOR_DRAWS = 8000  # that are used, evenly spread, since neighbours add little
_PRIOR_DRAWS, _OTHER_DRAWS = 4000, 1000  # for the share within reach, with the prior and with one of another width


def contour_evidence(model: ContourModel, sampled: Sampled, rng: np.random.Generator) -> Evidence:
    """Return the evidence of a model, over contours within reach; with priors of other widths by importance weights."""
    coordinates, (chains, _, size) = sampled.coordinates, sampled.draws.samples.shape
    kept = sampled.draws.evenly(_POSTERIOR_DRAWS // chains)
    points = sampled.draws.samples[:, kept].reshape(-1, size)
    transformed = coordinates.of(points)
    _, growth = coordinates.parameters(transformed)
    bridge = bridge_evidence(
        in_coordinates(model.log_probability, coordinates),
        transformed.reshape(chains, -1, size),
        sampled.draws.log_probability[:, kept] + growth.reshape(chains, -1),
        rng,
    )
    own = {name: model.priors[name] for name in model.family.parameters}
    logs, share = [], 0.0
    for width in WIDTHS:
        others = widened(own, width)
        change = np.zeros(len(points))
        for name, prior in others.items():
            if prior is not own[name]:
                values = points[:, model.names.index(name)]
                change += prior.logpdf(values) - own[name].logpdf(values)
        reached = model.share_within_reach(rng, _PRIOR_DRAWS if width == 1.0 else _OTHER_DRAWS, others)
        share = reached if width == 1.0 else share
        logs.append(bridge.log_evidence + weighed(change)[1] - np.log(reached))
    error = np.hypot(bridge.standard_error, np.sqrt((1.0 - share) / (share * _PRIOR_DRAWS)))
    return Evidence(np.array(logs), float(error), bridge.overlap)
