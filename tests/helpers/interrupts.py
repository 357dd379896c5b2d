"""Control-C at a moment that is known."""

import signal
import subprocess
import sys
import time

# Command line that does not converge, and prints a line whenever a sampler reports.
SAMPLING = """
import functools
from tactile_bayes.cli import main
from tactile_bayes.inference import contour, ensembles

made = contour.sample
def sample(*arguments, progress, **options):
    def show(state):
        print("sampling", flush=True)
        if progress is not None:
            progress(state)
    return made(*arguments, progress=show, **options)

contour.sample = sample
ensembles.SamplerSettings = functools.partial(ensembles.SamplerSettings, block_steps=5, min_ess=1e9)
main()
"""


def interrupted_at(call, function):
    """The function until it is called for so many times, when Control-C is pressed, and again after that."""
    count = 0

    def until_then(*arguments):
        nonlocal count
        count += 1
        if count == call:
            raise KeyboardInterrupt
        return function(*arguments)

    return until_then


def interrupted_while_sampling(command, record, cwd, *, setup=""):
    """Exit code, stdout and stderr of a command that writes to run/, when Control-C is pressed while it samples."""
    (cwd / "rig.toml").write_text('unknown = "nothing"\n', encoding="utf-8")
    arguments = [command, record, "--rig", "rig.toml", "--out", "run", "-q"]
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "encoding": "utf-8"}
    with subprocess.Popen([sys.executable, "-c", setup + SAMPLING, *arguments], cwd=cwd, **streams) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "sampling\n"
        time.sleep(0.5)  # while walkers walk, which is most of the time
        process.send_signal(signal.SIGINT)
        out, errors = process.communicate(timeout=300)
    return process.returncode, out, errors
