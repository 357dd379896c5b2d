"""The commands `dataset ...`: synthetic data sets made, checked, and taken apart into records."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tactile_bayes as tb
from tactile_bayes.cli.answer import Answer
from tactile_bayes.cli.command import Output, Writes, as_command
from tactile_bayes.cli.progress import WorkerOptions, counted, resumable_bar, step_bar
from tactile_bayes.runs.names import DATASET

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tactile_bayes.datasets.manifest import Manifest

dataset = typer.Typer(
    help="Synthetic data sets, made from a specification.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@dataset.command(epilog="Example: tactile-bayes dataset example > set.toml")
def example() -> None:
    """Print a commented specification to start from.

    It explains every section, distribution and unit.
    """
    from importlib.resources import files

    typer.echo(files("tactile_bayes.cli").joinpath("example.toml").read_text(encoding="utf-8"), nl=False)


@dataset.command(epilog="Example: tactile-bayes dataset generate set.toml --out set/")
@as_command
def generate(
    *,
    specification: Annotated[Path, "Specification, .toml: see dataset example.", typer.Argument(metavar="SPEC.toml")],
    out: Annotated[Path, "Folder for the data set; created if missing.", Writes(DATASET)],
    work: WorkerOptions,
    output: Output,
) -> Answer:
    """Make a data set, or resume a stopped run.

    The same specification gives the same numbers, however many workers there are.
    """
    from tactile_bayes.datasets.manifest import read_manifest

    spec = tb.datasets.read_specification(specification)
    last: tb.tasks.TaskProgress | None = None

    with resumable_bar("record", output.is_silent, out, spec.records) as note:

        def progress(made: tb.tasks.TaskProgress) -> None:
            nonlocal last
            last = made
            note(made)

        tb.datasets.generate(spec, out, workers=work.reporting(progress))
    manifest = read_manifest(out)
    return Answer(_words(out, manifest, last), lambda: {**_numbers(out, manifest), "made": last.made if last else 0})


@dataset.command(epilog="Example: tactile-bayes dataset verify set/ --regenerate 3")
@as_command
def verify(
    *,
    folder: Annotated[Path, "Folder of the data set.", typer.Argument()],
    regenerate: Annotated[int, "Files to be made again, and compared number by number.", typer.Option(min=0)] = 0,
    output: Output,
) -> Answer:
    """Check every byte of a data set.

    Files are compared with the checksums in the manifest, which also states the specification of the data set.
    """

    with step_bar(output.is_silent, "file", at_first="files to be read") as show:
        manifest = tb.datasets.verify(folder, regenerate=regenerate, progress=lambda verified: show(*verified))
    count = len(manifest.shards)
    again = min(regenerate, count)
    read = f"{folder}: {counted(manifest.records, 'record')} in {counted(count, 'file')}, every byte as it was written"
    compared = [f"{counted(again, 'file')} made again: every number is the same"] if regenerate else []
    return Answer([read, *compared], lambda: {**_numbers(folder, manifest), "verified": True, "made_again": again})


@dataset.command(epilog="Example: tactile-bayes dataset record set/ 0 --out record.csv")
@as_command
def record(
    *,
    source: Annotated[Path, "Folder of the data set, or its specification, .toml.", typer.Argument()],
    index: Annotated[int, "Number of the record; the first is 0.", typer.Argument()],
    out: Annotated[Path, "File for the record, .csv or .nc.", Writes()],
    truth: Annotated[bool, "Write the columns of the truth, or leave them out."] = True,
    output: Output,
) -> Answer:
    """Write one record to a file, as `infer` takes it."""

    found = tb.datasets.record(source, index, truth=truth)
    tb.write_record(found, out)
    samples = found.sizes["sample"]
    return Answer(
        [f"record {index} of {source}, {samples} samples: {out}"],
        lambda: {"index": index, "samples": samples, "units": found.attrs["units"], "files": {"record": out}},
    )


def _numbers(folder: Path, manifest: Manifest) -> dict[str, Any]:
    return {
        "records": manifest.records,
        "shards": len(manifest.shards),
        "bytes": sum(shard.bytes for shard in manifest.shards),
        "drawn_again": dict(manifest.redrawn),
        "strained": manifest.strained,
        "untouched": manifest.untouched,
        "files": {"folder": folder, "readme": folder / "README.md"},
    }


def _words(out: Path, manifest: Manifest, last: tb.tasks.TaskProgress | None) -> Iterator[str]:
    size = sum(shard.bytes for shard in manifest.shards)
    made = "all existed already, with the right sizes; dataset verify compares every byte"
    if last is not None:
        rate = last.made / max(last.seconds, 1e-9)
        made = f"{last.made:,} made in {last.seconds:.3g} s, {rate:,.0f} records/s"
    files = counted(len(manifest.shards), "file")
    yield f"{counted(manifest.records, 'record')} in {files}, {size / 1e6:,.1f} MB: {made}"
    if total := sum(manifest.redrawn.values()):
        why = ", ".join(f"{count:,} {reason}" for reason, count in manifest.redrawn.most_common())
        yield f"{total:,} contours were drawn again: {why}"
    if manifest.strained:
        strained = counted(manifest.strained, "record")
        yield f"{strained} with a rod strained beyond the model: their loads are unreliable"
    if manifest.untouched:
        yield f"{counted(manifest.untouched, 'sweep')} without a sample in contact"
    yield f"{out / 'README.md'} describes the files"
