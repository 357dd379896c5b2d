"""How many walkers walk, and when they may stop."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tactile_bayes.checks import check_number, check_optional, check_positive, check_whole_number, refused
from tactile_bayes.errors import ParameterError

__all__ = ["SamplerSettings", "refuse_few_walkers", "settings_of"]

_MOST = 10**9
"""Of ensembles, walkers and steps."""


@dataclass(frozen=True)
class SamplerSettings:
    """How many walkers walk, and when they may stop.

    Parameters
    ----------
    ensembles : int
        Number of independent ensembles, the chains of the result.
    walkers : int, optional
        Number of walkers of each ensemble, even and at least twice the number of parameters. By default the larger of
        48 and six times the number of parameters: the effective draws per evaluation hardly depend on it (Gaussian
        targets of 2 to 14 dimensions, 2 to 12 walkers per dimension), and a vectorised target and emcee itself are
        faster with more of them, but every one of them has to forget its start.
    block_steps : int
        Steps before the first look at the diagnostics, and the least between later ones, which come when the number of
        steps has grown by a quarter. Also the steps between two files of a checkpoint: what a killed run has to make
        again.
    max_r_hat : float
        Every parameter's rank-normalised R̂ must be below this (1.01: Vehtari et al. 2021, doi 10.1214/20-BA1221).
    min_ess : float
        Every parameter's effective sample size, in the bulk and in the tails, must reach this, and five for every
        walker: fewer would mean that walkers have not forgotten where they started.
    max_steps : int
        Steps after which each ensemble stops, converged or not.
    max_seconds : float, optional
        Time after which a posterior is content with what it has [s], counted from the call: the search for a start
        ends with the step that it is in, and the ensembles with theirs, of which they make at least one. It is
        exceeded by these steps, by a look at what is likely around the start (some 60 points for each parameter) and by
        the last diagnosis: a few seconds in all, more for records of thousands of samples, and for the first
        posterior after an installation, which waits for compilers. What is predicted from the draws, and files and
        figures, come after it. A run that ends by it is not reproducible from its seed. A run that goes on from a
        checkpoint has all of the time again; its search for a start, which must come to the same end each time, is
        counted, but not cut short.

    Raises
    ------
    ParameterError
        If a value is impossible.

    Examples
    --------
    >>> SamplerSettings(min_ess=400).walkers_for(9)
    54
    """

    ensembles: int = 4
    walkers: int | None = None
    block_steps: int = 50
    max_r_hat: float = 1.01
    min_ess: float = 1000.0
    max_steps: int = 20_000
    max_seconds: float | None = None

    def __post_init__(self) -> None:
        for name in ("block_steps", "max_steps"):
            check_whole_number(
                name, getattr(self, name), 1, f"give a whole number, at least 1 and at most {_MOST}", most=_MOST
            )
        remedy = (
            "give a whole number of at least 2 (4 is better), since convergence is judged by comparing independent "
            "ensembles; walkers of one ensemble are not independent"
        )
        check_whole_number("ensembles", self.ensembles, 2, remedy, most=_MOST)
        if self.walkers is not None:
            remedy = "give an even number of at least 4, or None for the default"
            if check_whole_number("walkers", self.walkers, 4, remedy, most=_MOST) % 2:
                raise refused("walkers", self.walkers, remedy)
        remedy = "R̂ is 1 at best, give a little more, like 1.01"
        check_number("max_r_hat", self.max_r_hat, remedy, least=math.nextafter(1.0, 2.0))
        check_positive("min_ess", self.min_ess)
        if self.max_seconds is not None:
            check_positive("max_seconds", self.max_seconds, "give a positive time [s], or None for no limit")

    def walkers_for(self, parameters: int) -> int:
        """Number of walkers of each ensemble for a target of this many parameters."""
        if self.walkers is None:
            return max(48, 6 * parameters)
        refuse_few_walkers(self.walkers, parameters)
        return self.walkers


def settings_of(settings: SamplerSettings | None) -> SamplerSettings:
    """Return the settings that are given, or the usual ones."""
    check_optional("settings", settings, SamplerSettings, "give SamplerSettings(min_ess=400) and the like")
    return SamplerSettings() if settings is None else settings


def refuse_few_walkers(walkers: int, parameters: int) -> None:
    if walkers < 2 * parameters:
        raise ParameterError(
            f"{walkers} walkers for {parameters} parameters: give at least {2 * parameters}, or the proposals of half "
            "an ensemble do not span the space"
        )
