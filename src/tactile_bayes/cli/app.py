"""The command `tactile-bayes`, with its treatment of errors, interrupts, warnings and streams."""

from __future__ import annotations

import codecs
import io
import os
import sys
import traceback
import unicodedata
import warnings
from collections.abc import Callable
from functools import partial
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

import tactile_bayes as tb
from tactile_bayes.cli.analysis import demo, infer
from tactile_bayes.cli.answer import Answer
from tactile_bayes.cli.calibration import calibrate, calibrate_rig
from tactile_bayes.cli.command import as_command
from tactile_bayes.cli.dataset import dataset
from tactile_bayes.cli.inspection import inspect, reconstruct
from tactile_bayes.cli.numbers import as_typed
from tactile_bayes.cli.pages import figures, report
from tactile_bayes.cli.plans import design, sensitivity
from tactile_bayes.cli.rigs import rig
from tactile_bayes.cli.simulation import measure, scan
from tactile_bayes.cli.verdicts import compare, trust
from tactile_bayes.cli.watching import watch
from tactile_bayes.errors import TactileBayesError, TactileBayesWarning
from tactile_bayes.matplotlib_defaults import ignore_user_settings

_HANDLER = "tactile_bayes.stand_in"

# Name of ASCII for streams, under which Typer does not take it for a mistake and write UTF-8.
_ASCII = "tactile_bayes_ascii"
# Characters, each before its stand-in.
_PAIRS = """
− - – - — - • * ° deg ± +/- × x · . ⋅ . ⁄ / √ sqrt ∞ inf ∂ d ∫ int ′ ' ≤ <= ≥ >= ≠ != ≈ ~ ∈ in → -> ⟹ =>
‘ ' ’ ' “ " ” " \N{MICRO SIGN} u \N{GREEK SMALL LETTER MU} u \N{COMBINING CIRCUMFLEX ACCENT} ^
"""
_WORDS = _PAIRS.split()
_STAND_INS = dict(zip(_WORDS[::2], _WORDS[1::2], strict=True))


class _Commands(TyperGroup):
    """Commands whose errors are a line on stderr and an exit code: 2 if refused, 130 if interrupted, else 1."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Store the arguments of the call, which a posterior states."""
        args = list(map(as_typed, args))
        ctx.meta["words"] = ("tactile-bayes", *args)
        return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        try:
            with warnings.catch_warnings():
                warnings.showwarning = partial(_show_warning, warnings.showwarning)
                return super().invoke(ctx)
        except (BrokenPipeError, typer.Exit, typer.Abort):  # the reader has closed the pipe, or a message was printed
            raise
        except KeyboardInterrupt as interrupt:
            words, code = str(interrupt) or "interrupted, results are incomplete", 130
        except Exception as error:
            if hasattr(error, "exit_code"):  # a wrong call, which typer reports with the usage
                raise
            words, code = _message(error)
            if ctx.params["debug"]:
                typer.echo(traceback.format_exc(), err=True)
            elif code == 1:
                words += "\nRun it again as tactile-bayes --debug ... to see the traceback."
        typer.echo(f"tactile-bayes: {words}", err=True)
        raise typer.Exit(code)


def _message(error: Exception) -> tuple[str, int]:
    """Return the message and the exit code of an error."""
    if isinstance(error, TactileBayesError):
        return str(error), 2
    if isinstance(error, OSError):
        where = f"{error.filename}: " if error.filename else ""
        return where + (error.strerror or str(error)), 2
    said = str(error).strip().partition("\n")[0] or "no message"
    return f"unexpected error, {type(error).__name__}: {said}", 1


def _show_warning(usual: Callable[..., None], message: Any, category: Any, *rest: Any, **more: Any) -> None:
    """Print a warning of this package as a line on stderr; warnings of other packages keep their form."""
    if issubclass(category, TactileBayesWarning):
        typer.echo(f"tactile-bayes: warning: {message}", err=True)
    else:
        usual(message, category, *rest, **more)


_EXIT_CODES = """Exit codes: 0 for done, 1 for an unexpected error, 2 for input or options that are refused, 130 for
Ctrl-C, 143 for a run that was terminated. A result that must not be trusted says so in its first line, and in "words"
and "converged" of --json; its exit code is 0. Parts that fail after sampling are named there and in "left_out".

Example: tactile-bayes demo --out results/demo

tactile-bayes --install-completion has the shell complete commands and options."""

app = typer.Typer(
    cls=_Commands,
    help="Contours from the loads at the base of a flexible rod: contact points, posteriors, bands.",
    epilog=_EXIT_CODES,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
_EXAMPLES: dict[Callable[..., Answer], str] = {
    scan: "scan --profile II --distance 0.5 --out ideal.csv",
    measure: "measure ideal.csv --force-noise 0.05 --moment-noise 0.02 --out measured.csv",
    rig: "rig inspection/rig.toml",
    inspect: "inspect rig.csv --length 0.2 --flexural-rigidity 0.0024 --split-sweeps --column 'force_x=Fx[mN]' "
    "--out inspection/",
    reconstruct: "reconstruct record.csv --out contacts/",
    infer: "infer record.csv --rig rig.toml --family parabola --out run/",
    compare: "compare record.csv --out run/",
    calibrate: "calibrate --family parabola --replicates 200 --out calibration/",
    sensitivity: "sensitivity --profile II --distance 0.5 --out sensitivity/",
    design: "design run/ --base 0.05,0 --base 0.1,0 --out design/",
    watch: "watch record.csv --family parabola --idle 60 --out run/",
    figures: "figures --only 3 --distance 0.4 --format pdf --out figures/",
    trust: "trust run/",
    calibrate_rig: "calibrate-rig gauge.csv --family circle --parameter r=0.01 --parameter q=0.05 --out rig/",
    report: "report run/",
    demo: "demo --out results/demo",
}
for _function, _example in _EXAMPLES.items():
    app.command(epilog=f"Example: tactile-bayes {_example}")(as_command(_function))
app.add_typer(dataset, name="dataset")


def main() -> None:
    """Run the command line."""
    os.environ["MPLBACKEND"] = "agg"  # figures go to files, also without a screen
    ignore_user_settings()
    accept_every_text()
    app()


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(tb.__version__)
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", help="Print the version and stop.", callback=_print_version, is_eager=True),
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error or a refusal.")] = False,
) -> None:
    pass


def accept_every_text() -> None:
    """Have stdout and stderr write a readable stand-in for each character that their encoding lacks."""
    codecs.register_error(_HANDLER, _encoded_by_stand_ins)
    codecs.register(_ascii_codec)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            is_ascii = codecs.lookup(stream.encoding).name == "ascii"
            stream.reconfigure(encoding=_ASCII if is_ascii else None, errors=_HANDLER)


def _ascii_codec(name: str) -> codecs.CodecInfo | None:
    if name != _ASCII:
        return None
    known = codecs.lookup("ascii")
    return codecs.CodecInfo(*known, known.incrementalencoder, known.incrementaldecoder, _ASCII)


def _encoded_by_stand_ins(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(_stand_in, error.object[error.start : error.end])), error.end


def _stand_in(character: str) -> str:
    """Return ASCII for a character: a sign like it, the name of a Greek letter, or the letter without its accents."""
    if character in _STAND_INS:
        return _STAND_INS[character]
    code = ord(character)
    if 0xDC80 <= code <= 0xDCFF:  # a byte in the name of a file that is no text
        return f"\\x{code - 0xDC00:02x}"
    name = unicodedata.name(character, "").split()
    if name[:1] == ["GREEK"]:
        letter = name[3] if name[2:3] == ["LETTER"] else name[1]
        return letter.capitalize() if "CAPITAL" in name else letter.lower()
    power = "^" if unicodedata.decomposition(character).startswith("<super>") else ""
    parts = unicodedata.normalize("NFKD", character)
    plain = "".join(part if part.isascii() else _STAND_INS.get(part, "") for part in parts if part != character)
    return power + plain if plain else "?"
