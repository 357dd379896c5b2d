"""Reproduction of a run: its command, and lines of Python that need only the posterior's file."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from typing import Any

from tactile_bayes.distributions import UNWRITTEN
from tactile_bayes.inference.result import OTHER, is_streamed
from tactile_bayes.tasks.documents import read_json


def command_of(attrs: Mapping[Any, Any]) -> str:
    """Return the shell command that made the run; "" if the posterior does not state it."""
    return shlex.join(read_json(attrs["command"], "command")) if "command" in attrs else ""


def python_lines(attrs: Mapping[Any, Any]) -> str:
    """Return lines of Python that infer the posterior again from the record in its file, and compare the draws."""
    seed, settings = str(attrs["seed"]), read_json(attrs["settings"], "settings")
    streamed = is_streamed(attrs)
    options = ["family=tb.Family.of(stored),", "rig=tb.Rig.of(stored),", f"rng={_seed(seed)},"]
    if streamed:
        options += [f"{name}={value!r}," for name, value in settings.items()]
    else:
        options += ["settings=tb.SamplerSettings(", *(f"    {n}={v!r}," for n, v in settings.items()), "),"]
    lines = [
        *(["import numpy as np"] if not seed.isdigit() else []),
        "import tactile_bayes as tb",
        "import xarray as xr",
        "",
        'stored = tb.read_result("posterior.nc")',
        'columns = [stored[group].to_dataset() for group in ("constant_data", "observed_data")]',
        "record = xr.merge(columns).assign_attrs(stored.attrs)",
        *(["stream = tb.Stream("] if streamed else ["again = tb.infer_contour(", "    record,"]),
        *(f"    {option}" for option in options),
        ")",
        *(["stream.update(record)", "again = stream.posterior()"] if streamed else []),
        'print(again["posterior"].equals(stored["posterior"]))',
    ]
    return "\n".join(lines)


def hindrances(attrs: Mapping[Any, Any]) -> list[str]:
    """Return reasons why the lines of Python may not give the same draws."""
    found = []
    if is_streamed(attrs):
        found.append("The samples came in blocks: taken at once, they give other draws of the same posterior.")
    elif str(attrs.get("sampler")).startswith(OTHER):
        found.append(f"The draws are of {attrs['sampler']}: infer_contour gives others of the same posterior.")
    if read_json(attrs["settings"], "settings").get("max_seconds") is not None:
        found.append("The run could end by the clock, after max_seconds: then the number of its steps is not repeated.")
    if "interrupted" in attrs["message"]:
        found.append("The run was interrupted: without an interrupt it makes more steps.")
    for text, argument in (("rig", "rig"), ("family_parameters", "family")):
        if attrs.get(text) == UNWRITTEN:
            found.append(f"A prior of your own is none of SciPy's: give {argument}= as before.")
    if not attrs.get("events", 1):
        found.append("Unloaded samples were left out (events=False), and are not in the file: drifts may differ.")
    return found


def _seed(words: str) -> str:
    """Return Python code for the seed, from the text of the attribute."""
    if words.isdigit():
        return words
    entropy, _, key = words.partition(", spawn key ")
    return f"np.random.SeedSequence({entropy}, spawn_key={key or '()'})"
