"""The bar that shows how far sampling has come."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tactile_bayes.inference.ensembles import Progress

__all__ = ["sampling_bar"]


class Show(Protocol):
    def __call__(self, progress: Progress, what: str = "", /) -> object:
        """Show progress, and of what it is where there is more than one thing."""


@contextmanager
def sampling_bar(quiet: bool) -> Iterator[Show | None]:
    """A bar that fills with the effective sample size; none where nobody sees it move."""
    from rich.console import Console
    from rich.progress import BarColumn, SpinnerColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    console = Console(stderr=True)
    if quiet or not console.is_terminal:
        yield None
        return
    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Bar(*columns, console=console, transient=True) as bar:
        task = bar.add_task("looking for a start, then sampling", total=1000.0)

        def show(progress: Progress, what: str = "", /) -> None:
            words = f"step {progress.steps}: R̂ {progress.r_hat:.3f}, effective draws {progress.ess:.0f}"
            words = f"{what}, {words}" if what else words
            bar.update(task, completed=min(progress.ess, 1000.0), description=words)

        yield show
