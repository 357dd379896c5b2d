"""The command `tactile-bayes` and what all its parts have in common: refusals, interrupts, version."""

from __future__ import annotations

from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from tactile_bayes.cli.analysis import demo, infer
from tactile_bayes.cli.calibration import calibrate
from tactile_bayes.cli.comparison import compare
from tactile_bayes.cli.dataset import dataset
from tactile_bayes.cli.design import design
from tactile_bayes.cli.sensitivity import sensitivity

__all__ = ["app", "main"]


class _Commands(TyperGroup):
    """Refusals are one line on stderr and exit code 2, an interrupt is exit code 130."""

    def invoke(self, ctx: Any) -> Any:
        from tactile_bayes.errors import TactileBayesError

        try:
            return super().invoke(ctx)
        except BrokenPipeError:  # whoever was reading has read enough
            raise
        except TactileBayesError as error:
            words, code = str(error), 2
        except OSError as error:
            where = f"{error.filename}: " if error.filename else ""
            words, code = where + (error.strerror or str(error)), 2
        except KeyboardInterrupt as interrupt:
            words, code = str(interrupt) or "interrupted, results are incomplete", 130
        typer.echo(f"tactile-bayes: {words}", err=True)
        raise typer.Exit(code)


app = typer.Typer(
    cls=_Commands,
    help="Contours from what a flexible rod's base feels: contact points, posteriors, bands.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.command(epilog="Example: tactile-bayes infer record.csv --family parabola --out run/")(infer)
app.command(epilog="Example: tactile-bayes compare record.csv --out run/")(compare)
app.command(epilog="Example: tactile-bayes calibrate --family parabola --replicates 200 --out calibration/")(calibrate)
app.command(epilog="Example: tactile-bayes sensitivity --profile II --distance 0.5 --out sensitivity/")(sensitivity)
app.command(epilog="Example: tactile-bayes design run/ --base 0.05,0 --base 0.1,0 --out design/")(design)
app.command(epilog="Example: tactile-bayes demo --out results/demo")(demo)
app.add_typer(dataset, name="dataset")


def main() -> None:
    """Entry point."""
    app()


def _print_version(wanted: bool) -> None:
    if wanted:
        from tactile_bayes import __version__

        typer.echo(__version__)
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", help="Print the version and stop.", callback=_print_version, is_eager=True),
    ] = False,
) -> None:
    pass
