"""The commands `dataset ...`: synthetic data sets made, checked, and taken apart into records."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tactile_bayes.cli.answer import Json, print_json
from tactile_bayes.cli.interrupts import going_on
from tactile_bayes.cli.record_options import Quiet
from tactile_bayes.cli.task_bar import counted, step_bar, task_bar
from tactile_bayes.cli.worker_options import Scheduler, Workers, refuse_both

if TYPE_CHECKING:
    from tactile_bayes.datasets import Production
    from tactile_bayes.datasets.manifest import Manifest

__all__ = ["dataset"]

dataset = typer.Typer(
    help="Synthetic data sets, made from a specification.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

Folder = Annotated[Path, typer.Argument(help="Folder of the data set.")]


@dataset.command(epilog="Example: tactile-bayes dataset example > set.toml")
def example() -> None:
    """Print a commented specification to start from.

    It explains every section, law and unit.
    """
    from importlib.resources import files

    typer.echo(files("tactile_bayes.cli").joinpath("example.toml").read_text(encoding="utf-8"), nl=False)


@dataset.command(epilog="Example: tactile-bayes dataset generate set.toml --out set/")
def generate(
    specification: Annotated[
        Path, typer.Argument(metavar="SPEC.toml", help="What to draw, sweep and measure: see dataset example.")
    ],
    out: Annotated[Path, typer.Option(help="Folder for the data set; made if it is not there.", file_okay=False)],
    workers: Workers = None,
    scheduler: Scheduler = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Make a data set, or go on where a run stopped.

    The same specification gives the same numbers, however many workers there are.
    """
    from tactile_bayes import datasets
    from tactile_bayes.datasets.manifest import read_manifest

    refuse_both(workers, scheduler)
    spec = datasets.read_specification(specification)
    last: Production | None = None

    def have() -> str:
        return f"{last.records:,} of {spec.records:,} records are in {out}" if last else "no further file was finished"

    with going_on(have) as raise_lost, task_bar(spec.records, "record", quiet or json) as show:

        def note(production: Production) -> None:
            nonlocal last
            last = production
            show(production.records)
            raise_lost()

        datasets.generate(spec, out, workers=workers, scheduler=scheduler, progress=note)
    if json:
        print_json(_numbers(out, read_manifest(out)) | {"made": last.made if last else 0})
        return
    _print_result(out, read_manifest(out), last)


@dataset.command(epilog="Example: tactile-bayes dataset verify set/ --regenerate 3")
def verify(
    folder: Folder,
    regenerate: Annotated[int, typer.Option(help="Files to be made again, and compared number by number.", min=0)] = 0,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Check every byte of a data set.

    Files are compared with the checksums in the manifest, which also says what the data set was made from.
    """
    from tactile_bayes import datasets

    with step_bar(quiet or json, "file", at_first="files to be read") as show:
        manifest = datasets.verify(folder, regenerate=regenerate, progress=lambda verified: show(*verified))
    count = len(manifest.shards)
    if json:
        print_json({**_numbers(folder, manifest), "verified": True, "made_again": min(regenerate, count)})
        return
    typer.echo(f"{folder}: {_records(manifest.records)} in {_files(count)}, every byte as it was written")
    if regenerate:
        typer.echo(f"{_files(min(regenerate, count))} made again: every number is the same")


@dataset.command(epilog="Example: tactile-bayes dataset record set/ 0 --out record.csv")
def record(
    source: Annotated[Path, typer.Argument(help="Folder of the data set, or its specification, .toml.")],
    index: Annotated[int, typer.Argument(help="Number of the record; the first is 0.")],
    out: Annotated[Path, typer.Option(help="File for the record, .csv or .nc.", dir_okay=False)],
    truth: Annotated[
        bool, typer.Option("--truth/--no-truth", help="With the columns of the truth, or as a laboratory has it.")
    ] = True,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Write one record to a file, as `infer` takes it."""
    from tactile_bayes import datasets, write_record

    found = datasets.record(source, index, truth=truth)
    write_record(found, out)
    if json:
        files = {"record": out}
        print_json({"index": index, "samples": found.sizes["sample"], "units": found.attrs["units"], "files": files})
        return
    typer.echo(f"record {index} of {source}, {found.sizes['sample']} samples: {out}")


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


def _print_result(out: Path, manifest: Manifest, last: Production | None) -> None:
    size = sum(shard.bytes for shard in manifest.shards)
    made = "all were there already, by their sizes; dataset verify compares every byte"
    if last is not None:
        made = f"{last.made:,} made in {last.seconds:.3g} s, {_rate(last)} records/s"
    typer.echo(f"{_records(manifest.records)} in {_files(len(manifest.shards))}, {size / 1e6:,.1f} MB: {made}")
    redrawn = manifest.redrawn
    if total := sum(redrawn.values()):
        why = ", ".join(f"{count:,} {reason}" for reason, count in redrawn.most_common())
        typer.echo(f"{total:,} contours were drawn again: {why}")
    if manifest.strained:
        typer.echo(
            f"{_records(manifest.strained)} with a rod strained beyond the model: their loads are not to be trusted"
        )
    if manifest.untouched:
        sweeps = f"{manifest.untouched:,} sweep{'s' * (manifest.untouched != 1)}"
        typer.echo(f"{sweeps} without a sample in contact")
    typer.echo(f"{out / 'README.md'} says what is in the files")


def _rate(production: Production) -> str:
    return f"{production.made / max(production.seconds, 1e-9):,.0f}"


def _records(count: int) -> str:
    return counted(count, "record")


def _files(count: int) -> str:
    return counted(count, "file")
