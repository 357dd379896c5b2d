"""The command `watch`: a contour while its record grows."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tactile_bayes.cli.analysis import answer_of, decimals
from tactile_bayes.cli.answer import Answer, columns_of, print_object
from tactile_bayes.cli.command import Out, Output, Seed, Writes
from tactile_bayes.cli.numbers import numbers_asked
from tactile_bayes.cli.progress import acknowledge_interrupt
from tactile_bayes.cli.rigs import RigFile, report_units
from tactile_bayes.errors import InferenceError, ParameterError, TactileBayesError
from tactile_bayes.runs.names import INFERENCE, OF_POSTERIOR, WATCH, WATCH_PAGE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tactile_bayes.rig import GrowingRecord, Growth
    from tactile_bayes.runs.watch import Watch, WatchUpdate

_STOPPING = "stopping; the last answer is checked, plotted and written now (Ctrl-C again leaves out a part of that)"
_STOPPED = "stopped by Ctrl-C or a signal"

# E-value above which the model is wrong: a right one reaches it in one record of a thousand at most.
_SURPRISING = 1000.0
_RARE = 0.001  # smallest probability of a shape that is written out
# Number of particles for each parameter below which quantiles can be off by several standard deviations.
_PER_PARAMETER = 30


def watch(
    *,
    ctx: typer.Context,
    record: Annotated[
        Path, "Record, .csv, to which another program appends rows; it may not be there yet.", typer.Argument()
    ],
    out: Annotated[Out, Writes((*INFERENCE, *OF_POSTERIOR, *WATCH))],
    family: Annotated[
        list[str] | None,
        "Shape, as in infer, by default parabola; may be repeated: the probability of each is then reported, and the "
        "band is averaged over them.",
    ] = None,
    rig: RigFile,
    probability: Annotated[float, "Probability of band and intervals.", typer.Option(min=0.0, max=1.0)] = 0.95,
    particles: Annotated[
        int, "Number of particles: four times as many are twice as exact, and take as long.", typer.Option(min=100)
    ] = 1000,
    between: Annotated[
        str | None, "Ends X,X of the band [m, or L]; by default those of what its sweeps touch if they go on."
    ] = None,
    until_width: Annotated[
        float | None, "End when the band is nowhere wider than this [m, or L] between the ends of --between."
    ] = None,
    until_probability: Annotated[
        float | None, "End when a shape of several has a greater probability.", typer.Option(min=0.0, max=1.0)
    ] = None,
    most_samples: Annotated[
        int,
        "Largest number of samples that are taken into account: of a longer record every second one is, every fourth, "
        "and so on.",
        typer.Option(min=100),
    ] = 1000,
    poll: Annotated[float, "Time from one look at the file to the next [s].", typer.Option(min=0.01)] = 0.5,
    idle: Annotated[
        float | None, "End when no row has come for so long [s]; by default Ctrl-C ends it.", typer.Option(min=0.0)
    ] = None,
    seed: Seed = 1,
    output: Output,
) -> Answer:
    """Infer the contour while its record is measured, with every block of new rows, until Ctrl-C.

    The folder has the stream, from which the same command resumes, the posterior, and watch.html, a page that loads
    itself again; at the end, which is no error, all that infer writes. With --json there is one object in each line:
    of each update, and of the end.
    """
    from tactile_bayes.rig import GrowingRecord
    from tactile_bayes.runs.watch import open_watch

    stated = rig.stated
    growing = GrowingRecord(record, stated)
    with open_watch(
        out,
        probability=probability,
        between=None if between is None else numbers_asked(between, "--between", 2),
        until_width=until_width,
        until_probability=until_probability,
        most_samples=most_samples,
        families=family or ["parabola"],
        record_file=record,
        command=ctx.meta["words"],
        rng=seed,
        particles=particles,
        rig=stated.without_bare_cell,
    ) as watched:
        follower = _Follower(record, growing, watched, stated.format.split_sweeps is True, output, poll, idle)
        try:
            with acknowledge_interrupt(_STOPPING):
                reason = follower.follow()
        except KeyboardInterrupt:
            reason = _STOPPED
        return _answer(ctx, follower, reason)


@dataclass
class _Follower:
    """A file, what is inferred from it, and what is printed of it."""

    path: Path
    growing: GrowingRecord
    watched: Watch
    splits_sweeps: bool
    output: Output
    poll: float
    idle: float | None
    last: WatchUpdate | None = None
    refusal: Exception | None = None
    messages: list[str] = field(default_factory=list)
    has_begun: bool = False
    is_late: bool = False
    parameters: int = 0
    e_value: float = 0.0

    def follow(self) -> str:
        """Take what comes, until the end; return its reason."""
        news = time.monotonic()
        while True:
            began = time.monotonic()
            growth = self.growing.poll()
            if growth is not None:
                self._take(growth)
                news = time.monotonic()
                if self.last is not None and self.last.enough:
                    return self.last.enough
            elif self.idle is not None and began - news >= self.idle:
                return f"no new rows for {self.idle:g} s"
            took = time.monotonic() - began
            self.is_late = took > self.poll
            time.sleep(max(0.0, self.poll - took))

    def tell(self, message: str) -> None:
        """Print a message on stderr, and keep it for the next line of numbers."""
        self.messages.append(message)
        typer.echo(f"tactile-bayes: warning: {message}", err=True)

    def _take(self, growth: Growth) -> None:
        for message in growth.messages:
            self.tell(message)
        if growth.is_other:
            self.watched.forget()
        if growth.error is not None and not (self.has_begun or growth.error.lines or self.splits_sweeps):
            raise growth.error
        if growth.record is None:
            self._refuse(growth.error)
            return
        if not self.has_begun:
            report_units(growth.record)
            self._show(self.watched.resume(growth.record, growth.sha256), growth)
            self.has_begun = True
        try:
            update = self.watched.take(growth.record, growth.sha256)
        except TactileBayesError as error:
            if self.last is None and isinstance(error, ParameterError):  # of an option, which no sample will change
                raise
            self._refuse(error)
            return
        self.refusal = None
        self._show(update, growth)

    def _refuse(self, error: Exception | None) -> None:
        """Report why samples are not taken into account, once."""
        if error is not None and str(error) != str(self.refusal):
            self.tell(f"{error} (waiting for more rows)")
        self.refusal = error

    def _show(self, update: WatchUpdate | None, growth: Growth) -> None:
        """Write the page, and print an answer."""
        from tactile_bayes.report.wording import sentence

        if update is None:
            return
        every_before, self.last = self.last.every if self.last else 1, update
        now = time.time()
        behind = max(0.0, now - growth.written_at)
        self._warn(update, every_before)
        headline, families, band = _counted(update, self.is_late), _families(update), _band(update)
        late = f"The answer is {behind:.1f} s behind its newest sample."
        words = [*families, f"{sentence(band)}.", late, *(f"{message}." for message in self.messages)]
        self.write_page(headline, words, is_well=not self.messages)
        if self.output.json:
            print_object(self._numbers(update, now, behind), in_a_line=True)
        elif not self.output.quiet:
            typer.echo(f"{headline}; {band}; {behind:.1f} s behind")
            for line in [*families, _parameters(update)]:
                typer.echo(f"    {line}")
        self.messages.clear()

    def _warn(self, update: WatchUpdate, every_before: int) -> None:
        """Warn of what an answer cannot be trusted for, once."""
        count, parameters = update.posterior["posterior"].sizes["draw"], update.summary.sizes["quantity"]
        if self.parameters < parameters and count < _PER_PARAMETER * parameters:
            self.tell(
                f"{count} particles are few for {parameters} parameters, so that intervals may be wrong: give "
                f"--particles {_PER_PARAMETER * parameters} or more"
            )
        self.parameters = parameters
        if update.every != every_before:
            of = "all samples are" if update.every == 1 else f"one sample of {update.every} is"
            self.tell(f"{of} taken from now on, also of those before (--most-samples)")
        if update.restarted:
            self.tell(
                f"earlier samples have changed or new ones do not follow in order: all {update.samples:,} taken again"
            )
        if update.e_value > _SURPRISING >= self.e_value:
            self.tell(
                f"samples are not what the shape, the rig and the noise predict (e-value {update.e_value:.2g}; that of "
                f"a right model exceeds {_SURPRISING:,.0f} in one record of a thousand at most): do not rely on the "
                "band, and try another --family, or infer more of the rig ([unknown] of rig.toml)"
            )
        self.e_value = max(self.e_value, update.e_value)

    def write_page(self, headline: str, sentences: Sequence[str], *, is_well: bool, is_last: bool = False) -> None:
        """Write the page of the last answer."""
        from tactile_bayes.report.writing import write_watch_page

        assert self.last is not None
        write_watch_page(
            self.last.posterior,
            self.last.summary,
            self.last.band,
            self.watched.folder.path / WATCH_PAGE,
            headline=headline,
            sentences=sentences,
            is_well=is_well and bool(self.last.posterior.attrs["converged"]),
            refresh=None if is_last else max(1, math.ceil(self.poll)),
        )

    def _numbers(self, update: WatchUpdate, now: float, behind: float) -> dict[str, Any]:
        return {
            "event": "update",
            "time": datetime.fromtimestamp(now).astimezone().isoformat(timespec="milliseconds"),
            **{name: getattr(update, name) for name in ("samples", "new", "restarted", "every", "seconds", "e_value")},
            "taken_together": self.is_late,
            "seconds_behind": behind,
            "probability": update.summary.attrs["probability"],
            "quantities": columns_of(update.summary, "quantity"),
            "band_width": update.width,
            "probabilities": dict(update.probabilities),
            "may_stop": bool(update.enough),
            "converged": bool(update.posterior.attrs["converged"]),
            "message": update.posterior.attrs["message"],
            "warnings": list(self.messages),
        }


def _answer(ctx: typer.Context, follower: _Follower, reason: str) -> Answer:
    """Return the last answer, with the files of a run."""
    from tactile_bayes.report.wording import sentence

    last = follower.last
    if last is None:
        if follower.refusal is not None:
            raise follower.refusal
        if reason == _STOPPED:
            raise KeyboardInterrupt("interrupted before the first answer")
        raise InferenceError(f"{follower.path}: {reason}, and there is no sample in it")
    run = follower.watched.finish()
    left_out = f", one of {last.every} that were measured" if last.every > 1 else ""
    said = f"Ended after {last.samples:,} samples{left_out}: {reason}"
    words = [*run.messages, *_families(last), f"{sentence(_band(last))}."]
    follower.write_page(said, words, is_well=run.checked is not None and run.checked.is_well, is_last=True)
    folder = follower.watched.folder.path
    files = {**run.files, "stream": follower.watched.state, "page": folder / WATCH_PAGE}
    answer = answer_of(ctx, run, files, {}, "")
    return replace(
        answer,
        parts=[f"{said}.", *_families(last), "", *answer.parts],
        numbers=lambda: {"event": "end", "reason": reason, "samples_taken": last.samples, **answer.numbers()},
        in_a_line=True,
    )


def _counted(update: WatchUpdate, is_late: bool) -> str:
    """Return text like "84 samples, 28 new"."""
    if not update.new:
        return f"{update.samples:,} samples, resumed"
    together = " taken together, since the update before took longer than --poll" if is_late else ""
    return f"{update.samples:,} samples, {update.new:,} new{together}"


def _families(update: WatchUpdate) -> list[str]:
    """Return a sentence on the probabilities of families, the most probable one first; none for a single family."""
    from tactile_bayes.report.wording import percent

    if not update.probabilities:
        return []
    in_order = sorted(update.probabilities.items(), key=lambda item: -item[1])
    shares = [f"{name} {'<' if p < _RARE else ''}{percent(max(round(p, 3), _RARE))}" for name, p in in_order]
    probable = ", ".join(shares)
    if small := ", ".join(update.underrated):
        probable += f"; too small for {small}: their particles had lost the posterior for a while"
    return [f"Probability of the shapes: {probable}; parameters are those of the first, the band is averaged."]


def _band(update: WatchUpdate) -> str:
    from tactile_bayes.report.wording import percent, shown_as

    if not math.isfinite(update.width) or update.band is None:
        return "no band yet"
    attrs = update.band["lower"].attrs
    ends = update.band["x"].values[[0, -1]]
    unit, fine = shown_as("contact_x", attrs, ends), shown_as("contact_x", attrs, [update.width])
    share = percent(float(update.summary.attrs["probability"]))
    between = f"from x = {unit.text(ends[0], 2)} to {unit.full(ends[1], 2)}"
    return f"band up to {fine.full(update.width, 2)} wide ({share}) {between}"


def _parameters(update: WatchUpdate) -> str:
    """Return the parameters of the contour with their intervals."""
    from tactile_bayes.contours.families import family_named

    shape = family_named(str(update.posterior.attrs["family"]))
    parts = []
    for name in [name for name in shape.parameters if name not in shape.roughness]:
        row: Any = update.summary.sel(quantity=name)
        digits = decimals(float(row["upper"] - row["lower"]))
        middle, low, high = (f"{float(row[column]):.{digits}f}" for column in ("median", "lower", "upper"))
        unit = str(row["unit"].values)
        parts.append(f"{name} {middle} ({low} to {high}){'' if unit == '1' else f' {unit}'}")
    return ", ".join(parts)
