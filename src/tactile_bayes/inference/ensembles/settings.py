"""Settings of the sampler: size of the ensembles, and criteria for stopping."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tactile_bayes.checks import check_number, check_optional, check_positive, check_switch, check_whole_number, refused
from tactile_bayes.errors import ParameterError

_MOST = 10**9  # largest number of ensembles, walkers and steps
_MOST_STEPS = 20_000  # by default


@dataclass(frozen=True)
class SamplerSettings:
    """Settings of the sampler: size of the ensembles, and criteria for stopping.

    Parameters
    ----------
    ensembles : int
        Number of independent ensembles, the chains of the result.
    walkers : int, optional
        Number of walkers of each ensemble, even and at least twice the number of parameters. By default six times the
        number of parameters, between 48 and 84, and at least three times: the effective draws per evaluation hardly
        depend on it, and more of them are faster, but each has to forget its start. A shape-free contour, whose
        coordinates are nearly normal, has twice the number of parameters.
    block_steps : int
        Number of steps before the first diagnosis, and at most between writes of a checkpoint. Later diagnoses come
        when the steps have grown by a quarter.
    max_r_hat : float
        Every parameter's rank-normalised R̂ must be below this (1.01: Vehtari et al. 2021, doi 10.1214/20-BA1221).
    min_ess : float
        Every parameter's effective sample size, in the bulk and in the tails, must reach this, and three for every
        walker: fewer would mean that walkers have not forgotten their starting points.
    max_steps : int, optional
        Number of steps after which each ensemble stops, converged or not. By default 20,000, and 25, as many as a
        verdict needs, where the best parameters of a contour leave what no noise explains.
    max_seconds : float, optional
        Time limit of a posterior [s], counted from the call: the search for a start ends with its present step, and so
        do the ensembles, which make at least one step. A few seconds may come on top, more at the first posterior after
        an installation, and predictions, files and figures do. A run that ends by it is not reproducible from its seed.
        A run that resumes from a checkpoint has the whole time again; its search for a start is counted, not cut short.
    events : bool
        Whether unloaded samples count, which show where contact begins and ends. Otherwise only samples count whose
        load exceeds the noise, as in methods that use contacts alone.

    Raises
    ------
    ParameterError
        If a value is not valid.

    Examples
    --------
    >>> SamplerSettings(min_ess=400).walkers_for(9)
    54
    """

    ensembles: int = 4
    walkers: int | None = None
    block_steps: int = 25
    max_r_hat: float = 1.01
    min_ess: float = 1000.0
    max_steps: int | None = None
    max_seconds: float | None = None
    events: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "events", check_switch("events", self.events))
        for name in ("block_steps", "max_steps"):
            if (number := getattr(self, name)) is not None or name == "block_steps":
                check_whole_number(name, number, 1, f"give a whole number, at least 1 and at most {_MOST}", most=_MOST)
        correction = (
            "give a whole number of at least 2 (4 is better), since convergence is judged by comparing independent "
            "ensembles; walkers of one ensemble are not independent"
        )
        check_whole_number("ensembles", self.ensembles, 2, correction, most=_MOST)
        if self.walkers is not None:
            correction = "give an even number of at least 4, or None for the default"
            if check_whole_number("walkers", self.walkers, 4, correction, most=_MOST) % 2:
                raise refused("walkers", self.walkers, correction)
        correction = "R̂ is 1 at best, give a little more, like 1.01"
        check_number("max_r_hat", self.max_r_hat, correction, least=math.nextafter(1.0, 2.0))
        check_positive("min_ess", self.min_ess)
        if self.max_seconds is not None:
            check_positive("max_seconds", self.max_seconds, "give a positive time [s], or None for no limit")

    @property
    def most_steps(self) -> int:
        """Number of steps after which each ensemble stops."""
        return _MOST_STEPS if self.max_steps is None else self.max_steps

    def walkers_for(self, parameters: int) -> int:
        """Return the number of walkers of each ensemble for a target of this many parameters."""
        check_whole_number("parameters", parameters, 1)
        if self.walkers is None:
            return max(48, min(6 * parameters, 84), 3 * parameters + parameters % 2)
        if self.walkers < 2 * parameters:
            raise ParameterError(
                f"{self.walkers} walkers for {parameters} parameters: give at least {2 * parameters}, or the proposals "
                "of half an ensemble do not span the space"
            )
        return self.walkers


def settings_of(settings: SamplerSettings | None) -> SamplerSettings:
    """Return the given settings, or the default ones; refuse other objects."""
    check_optional("settings", settings, SamplerSettings, "give SamplerSettings(min_ess=400) and the like")
    return SamplerSettings() if settings is None else settings
