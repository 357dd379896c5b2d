"""Replicates that fail, for processes as well: functions of a module, which patch where they run."""

import pytest

from helpers.tasks import StrangeError
from tactile_bayes.calibration import replicate as module

# Functions that fail in replicates 0, 1 and 2, and what their errors say.
STAGES = {"simulate": "of the simulation", "sampled": "of inference", "_snap_offs": "of what comes after"}
_REPLICATE = module.replicate


def failing(task):
    """A replicate, where the first three fail, each at another stage, with an error that nobody expects."""
    number = task[1]
    if number >= len(STAGES):
        return _REPLICATE(task)
    stage, words = list(STAGES.items())[number]

    def fail(*arguments, **options):
        raise StrangeError("an error", words)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, stage, fail)
        return _REPLICATE(task)
