"""The data card: a description of a data set in its folder."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby

from tactile_bayes.datasets.manifest import Manifest
from tactile_bayes.datasets.specification import Specification
from tactile_bayes.mechanics.rods.rod import LARGEST_STRAIN

CARD = "README.md"

_CARD = """\
# {name}

{description}Simulated sweeps of {rod} along strictly convex contours: {records} records of {sweeps} with {samples} \
samples each, in {files} NetCDF file{s}, {size:.1f} MB. {units}

```python
import tactile_bayes as tb

data = tb.datasets.open(".")  # xarray, nothing is read before it is used
record = tb.datasets.record(".", 0)  # one record, as infer_contour and the like take it
```

## What is drawn

| quantity | distribution |
|---|---|
{rows}

{draws}

## What is in the files

Dimensions are record, sweep and sample. `drive_angle`, `holding_moment`, `force_x` and `force_y` are what encoder and \
load cell read; what begins with `truth_` is what they would read without error, the contact (NaN out of contact, \
where loads are 0), the contour's parameters (NaN where its family has none of that name), and first contact, snap-off \
and phases of each sweep. Whole numbers with `flag_meanings` stand for words. Numbers over samples have {bits} bits; \
true loads are right to 1e-6 of the largest.

{not_stored}## Where it is from

Seed {seed}; specification {sha256:.16}…, whole in `manifest.json` with a checksum of each file: `tactile-bayes \
dataset verify .` compares every byte. Made with {versions}; the same specification gives the same numbers with these \
versions, whatever the workers.

The physics: L. Merker, C. Will, J. Steigenberger, C. Behn, Math. Probl. Eng. 2018, 1613945, \
doi 10.1155/2018/1613945.
"""


def card(spec: Specification, manifest: Manifest) -> str:
    """Return the data card, in Markdown."""
    files, bases = len(manifest.shards), len(spec.bases)
    rod, where = "a flexible rod on a pivot", "" if bases == 1 else f" from {bases} bases"
    sweeps = f"{len(spec.sweeps)} sweeps ({', '.join(spec.directions)}{where})"
    if spec.translations:
        rod, sweeps = "a flexible rod that is carried", f"{spec.sweep_count} sweep{'s' * (spec.sweep_count != 1)}"
    units = "Lengths in rod lengths L, forces in EI/L², moments in EI/L, angles in rad."
    if spec.units == "SI":
        units = "Lengths in m, forces in N, moments in N m."
    return _CARD.format(
        name=spec.name,
        description=f"{spec.description.strip()}\n\n".lstrip("\n"),
        rod=rod,
        records=spec.records,
        sweeps=sweeps,
        samples=spec.drive.samples,
        files=files,
        s="s" * (files != 1),
        size=sum(shard.bytes for shard in manifest.shards) / 1e6,
        units=units,
        rows="\n".join(f"| {quantity} | {distribution} |" for quantity, distribution in _rows(spec)),
        draws="\n\n".join(_draws(spec, manifest)),
        bits=32 if spec.single else 64,
        not_stored="".join(f"{sentence}\n\n" for sentence in _not_in_the_files(spec)),
        seed=spec.seed,
        sha256=spec.sha256,
        versions=", ".join(f"{name} {number}" for name, number in manifest.versions.items()),
    )


def _rows(spec: Specification) -> Iterator[tuple[str, str]]:
    """Yield quantities, and how they are drawn or what they are."""
    for name, group in zip(_names(spec), spec.groups, strict=True):
        share = "in turn" if spec.each_group else f"weight {group.weight:g}"
        yield f"**{name}**", share if len(spec.groups) > 1 else "always"
        # The many weights of a shape-free contour share a row if they have the same distribution.
        alike = groupby(
            group.distributions.items(), lambda entry: entry[1].text if entry[0].startswith("z_") else entry[0]
        )
        for _, entries in alike:
            (first, distribution), *others = entries
            yield f"{name}: {f'{first} to {others[-1][0]}' if others else first}", distribution.text
    pivots = {f"pivot {k}" if len(spec.bases) > 1 else "pivot": pair for k, pair in enumerate(spec.bases, start=1)}
    off = spec.unknown if spec.friction is None else {n: of for n, of in spec.unknown.items() if n != "friction"}
    tables = {
        "rod": spec.rod,
        **{pivot: dict(zip("xy", pair, strict=True)) for pivot, pair in pivots.items()},
        **{f"translation {k}": one for k, one in enumerate(spec.translations, start=1)},
        "load cell": spec.load_cell,
        "deviation of the rig": off,
    }
    for what, table in tables.items():
        yield from ((f"{what}: {name}", of.text) for name, of in table.items())
    drive = spec.drive
    if spec.translations:
        yield "samples", f"{drive.samples}, evenly spaced from the beginning of the travel to its end"
    elif drive.begin is None:
        yield "drive angles", f"from first contact to snap-off, and {drive.margin:g} of that on either side"
    else:
        yield "drive angles", f"{drive.begin:.6g} to {drive.end:.6g} rad"
    if spec.friction is not None:
        yield "friction", f"{spec.friction:g}"
    yield "frame of the load cell", spec.frame


def _names(spec: Specification) -> list[str]:
    """Name each group of contours by its family, with a number if a family occurs more than once."""
    families = [group.family for group in spec.groups]
    return [
        f"{family} {families[: index + 1].count(family)}" if families.count(family) > 1 else family
        for index, family in enumerate(families)
    ]


def _draws(spec: Specification, manifest: Manifest) -> Iterator[str]:
    """Describe the order of lists, the rejected draws and their effect, and records that may not be suitable."""
    if spec.lists:
        times = spec.records // spec.combinations
        often = "once" if times == 1 else f"{times} times"
        names = []
        for name, _ in spec.lists:
            in_step = " and ".join(key for key, distribution in spec.distributions if distribution.axis == name)
            names.append(f"{name} ({in_step} in step)" if in_step else name)
        every = f"the {spec.combinations} entries of {names[0]}, {often}."
        if len(names) > 1:
            every = f"all {spec.combinations} combinations of the lists, {often}, the last of these fastest: "
            every += f"{'; '.join(names)}."
        yield f"Records go through {every}"
    whatever = (
        " reaches" if spec.drive.begin is None else ", driven far enough, reaches, whatever the drive angles above,"
    )
    reached = f"that every sweep{whatever} and that the rod is clear of after snap-off"
    why = ", ".join(f"{count} {reason}" for reason, count in sorted(manifest.redrawn.items()))
    if total := sum(manifest.redrawn.values()):
        yield f"{total} contours were drawn again ({why}), so the distributions above hold among contours {reached}."
    else:
        yield f"Every contour drawn is one {reached}."
    if manifest.untouched or spec.drive.begin is not None:
        sweeps = spec.records * spec.sweep_count
        yield f"Of {sweeps} sweeps, {manifest.untouched} have no sample in contact (`truth_contact_phase`)."
    if spec.has_thickness:
        yield (
            f"In {manifest.strained} of {spec.records} records the rod is strained beyond {LARGEST_STRAIN:g} "
            "(`truth_largest_strain`): it is neither slender nor linearly elastic there, and the loads are not to be "
            "trusted."
        )


def _not_in_the_files(spec: Specification) -> Iterator[str]:
    """Describe parts of the readings that the files do not contain, or contain with rounding."""
    if any(name.startswith(("bias_uncertainty", "random_walk", "ornstein_uhlenbeck")) for name in spec.load_cell):
        yield (
            "The drift and the unknown bias of a record are not stored: readings minus true loads contain them, with "
            "the noise."
        )
    if spec.single and any(name.endswith("_range") for name in spec.load_cell):
        yield (
            "Readings at the end of the load cell's range are that end rounded to 32 bits, and may be a little less or "
            "more; `tb.datasets.record` gives them back as the end itself."
        )
