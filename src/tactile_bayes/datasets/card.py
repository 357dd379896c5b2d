"""The data card: a description of a data set in its folder."""

from __future__ import annotations

from itertools import groupby

from tactile_bayes.datasets.manifest import Manifest
from tactile_bayes.datasets.specification import Specification
from tactile_bayes.mechanics.rods.rod import LARGEST_STRAIN

CARD = "README.md"


def card(spec: Specification, manifest: Manifest) -> str:
    """Return the data card, in Markdown."""
    size = sum(shard.bytes for shard in manifest.shards)
    files = len(manifest.shards)
    bases = len(spec.bases)
    where = "" if bases == 1 else f" from {bases} bases"
    rod = "a flexible rod that is carried" if spec.translations else "a flexible rod on a pivot"
    sweeps = f"{len(spec.sweeps)} sweeps ({', '.join(spec.directions)}{where})"
    if spec.translations:
        sweeps = f"{spec.sweep_count} sweep{'s' * (spec.sweep_count != 1)}"
    lines = [
        f"# {spec.name}",
        "",
        *([spec.description.strip(), ""] if spec.description.strip() else []),
        f"Simulated sweeps of {rod} along strictly convex contours: {spec.records} records of "
        f"{sweeps} with {spec.drive.samples} samples each, in "
        f"{files} NetCDF file{'s' * (files != 1)}, {size / 1e6:.1f} MB. "
        + ("Lengths in m, forces in N, moments in N m." if spec.units == "SI" else
           "Lengths in rod lengths L, forces in EI/L², moments in EI/L, angles in rad."),
        "",
        "```python",
        "import tactile_bayes as tb",
        "",
        'data = tb.datasets.open(".")  # xarray, nothing is read before it is used',
        'record = tb.datasets.record(".", 0)  # one record, as infer_contour and the like take it',
        "```",
        "",
        "## What is drawn",
        "",
        "| quantity | distribution |",
        "|---|---|",
    ]  # fmt: skip
    for name, group in zip(_names(spec), spec.groups, strict=True):
        share = "in turn" if spec.each_group else f"weight {group.weight:g}"
        lines.append(f"| **{name}** | {share if len(spec.groups) > 1 else 'always'} |")
        # The many weights of a shape-free contour share a row if they have the same distribution.
        alike = groupby(
            group.distributions.items(), lambda entry: entry[1].text if entry[0].startswith("z_") else entry[0]
        )
        for _, entries in alike:
            (first, distribution), *others = entries
            lines.append(f"| {name}: {f'{first} to {others[-1][0]}' if others else first} | {distribution.text} |")
    lines += [f"| rod: {name} | {distribution.text} |" for name, distribution in spec.rod.items()]
    for number, pair in enumerate(spec.bases, start=1):
        pivot = "pivot" if bases == 1 else f"pivot {number}"
        lines += [f"| {pivot}: {axis} | {distribution.text} |" for axis, distribution in zip("xy", pair, strict=True)]
    for number, one in enumerate(spec.translations, start=1):
        lines += [f"| translation {number}: {name} | {distribution.text} |" for name, distribution in one.items()]
    lines += [f"| load cell: {name} | {distribution.text} |" for name, distribution in spec.load_cell.items()]
    off = [(name, of.text) for name, of in spec.unknown.items() if not (name == "friction" and of.kind == "constant")]
    lines += [f"| deviation of the rig: {name} | {text} |" for name, text in off]
    drive = spec.drive
    if spec.translations:
        lines.append(f"| samples | {drive.samples}, evenly spaced from the beginning of the travel to its end |")
    elif drive.begin is None:
        lines.append(f"| drive angles | from first contact to snap-off, and {drive.margin:g} of that on either side |")
    else:
        lines.append(f"| drive angles | {drive.begin:.6g} to {drive.end:.6g} rad |")
    lines += [
        *([] if spec.friction is None else [f"| friction | {spec.friction:g} |"]),
        f"| frame of the load cell | {spec.frame} |",
        "",
        *_in_turn(spec),
        _redrawn(spec, manifest),
        "",
        *_to_beware_of(spec, manifest),
        "## What is in the files",
        "",
        "Dimensions are record, sweep and sample. `drive_angle`, `holding_moment`, `force_x` and `force_y` are what "
        "encoder and load cell read; what begins with `truth_` is what they would read without error, the contact (NaN "
        "out of contact, where loads are 0), the contour's parameters (NaN where its family has none of that name), "
        "and first contact, snap-off and phases of each sweep. Whole numbers with `flag_meanings` stand for words. "
        f"Numbers over samples have {32 if spec.single else 64} bits; true loads are right to 1e-6 of the largest.",
        "",
        *_not_in_the_files(spec),
        "## Where it is from",
        "",
        f"Seed {spec.seed}; specification {spec.sha256[:16]}…, whole in `manifest.json` with a checksum of each file: "
        "`tactile-bayes dataset verify .` compares every byte. Made with "
        + ", ".join(f"{name} {number}" for name, number in manifest.versions.items())
        + "; the same specification gives the same numbers with these versions, whatever the workers.",
        "",
        "The physics: L. Merker, C. Will, J. Steigenberger, C. Behn, Math. Probl. Eng. 2018, 1613945, "
        "doi 10.1155/2018/1613945.",
        "",
    ]
    return "\n".join(lines)


def _names(spec: Specification) -> list[str]:
    """Name each group of contours by its family, with a number if a family occurs more than once."""
    families = [group.family for group in spec.groups]
    return [
        f"{family} {families[: index + 1].count(family)}" if families.count(family) > 1 else family
        for index, family in enumerate(families)
    ]


def _in_turn(spec: Specification) -> list[str]:
    """Describe the order in which the lists are used."""
    if not spec.lists:
        return []
    times = spec.records // spec.combinations
    often = "once" if times == 1 else f"{times} times"
    names = [_of_axis(spec, name) for name, _ in spec.lists]
    if len(names) == 1:
        return [f"Records go through the {spec.combinations} entries of {names[0]}, {often}.", ""]
    return [
        f"Records go through all {spec.combinations} combinations of the lists, {often}, the last of these fastest: "
        f"{'; '.join(names)}.",
        "",
    ]


def _of_axis(spec: Specification, name: str) -> str:
    """Describe the list of this name, or those on the axis of this name."""
    together = [key for key, distribution in spec.distributions if distribution.axis == name]
    return f"{name} ({' and '.join(together)} in step)" if together else name


def _redrawn(spec: Specification, manifest: Manifest) -> str:
    """Describe the number of rejected draws, and their effect on the distributions."""
    reached = "that every sweep reaches and that the rod is clear of after snap-off"
    if spec.drive.begin is not None:
        reached = (
            "that every sweep, driven far enough, reaches, whatever the drive angles above, and that the rod is clear "
            "of after snap-off"
        )
    if not (total := sum(manifest.redrawn.values())):
        return f"Every contour drawn is one {reached}."
    why = ", ".join(f"{count} {reason}" for reason, count in sorted(manifest.redrawn.items()))
    return f"{total} contours were drawn again ({why}), so the distributions above hold among contours {reached}."


def _to_beware_of(spec: Specification, manifest: Manifest) -> list[str]:
    """Describe records that may not be suitable."""
    lines = []
    sweeps = spec.records * spec.sweep_count
    if manifest.untouched or spec.drive.begin is not None:
        lines += [f"Of {sweeps} sweeps, {manifest.untouched} have no sample in contact (`truth_contact_phase`).", ""]
    if spec.has_thickness:
        lines += [
            f"In {manifest.strained} of {spec.records} records the rod is strained beyond {LARGEST_STRAIN:g} "
            "(`truth_largest_strain`): it is neither slender nor linearly elastic there, and the loads are not to be "
            "trusted.",
            "",
        ]
    return lines


def _not_in_the_files(spec: Specification) -> list[str]:
    """Describe parts of the readings that the files do not contain, or contain with rounding."""
    lines = []
    if any(name.startswith(("bias_uncertainty", "random_walk", "ornstein_uhlenbeck")) for name in spec.load_cell):
        lines += [
            "The drift and the unknown bias of a record are not stored: readings minus true loads contain them, with "
            "the noise.",
            "",
        ]
    if spec.single and any(name.endswith("_range") for name in spec.load_cell):
        lines += [
            "Readings at the end of the load cell's range are that end rounded to 32 bits, and may be a little less or "
            "more; `tb.datasets.record` gives them back as the end itself.",
            "",
        ]
    return lines
