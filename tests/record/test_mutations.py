"""Mutated CSV files: each is refused in words of our own, or is read and can be written again."""

import re
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from helpers.record_tables import WIRE, columns
from tactile_bayes.errors import RecordError
from tactile_bayes.record import make_record, read_record, write_record

RIG = Path(__file__).parents[2] / "data" / "synthetic" / "rig.csv"
RIG_OPTIONS = {
    "columns": {"drive_angle": "90-Angle[deg]", "holding_moment": "Mz", "force_x": "Fx[mN]", "force_y": "Fy"},
    "split_sweeps": True,
    "rod": WIRE,
}

CELLS = [
    *("", " ", "0", "-0.0", "1e400", "-1e-400", "nan", "inf", "-inf", "1_0", "1,5", "1.5", "0x1F", "true", "١٢"),
    *("9" * 19, "-9223372036854775808", "9" * 5000, "-" + "1" * 4301, "0" * 5000 + "1", "1." + "0" * 200_000 + "1"),
    *('"', '""', '"a', 'a"b', "a\0", "\0", "\0b", "\ud800", "\x1a", "forward"),
    *("x" * 131_072, "x" * 131_073, f'"{"y;" * 70_000}"'),
]
UNITS = [
    *("m", "mm", "Nm", "deg", "1", "", "furlong", "°C", "/" * 99, '"', "]", "[", "\\ud800", "\0"),
    *("Gm9/pm9", "Gm9 Gm9 Gm9/Gm9 Gm9", "Gm9 " * 40, "Gm9" * 40_000, "m-9 " * 40, "N" * 5000),
]
NAMES = [
    *("sample", "direction", "direction_length", "note_length", "string7", "", ".", "a/b", "x" * 300, "x" * 70_000),
    *("CLASS", "NAME", "_NCProperties", "_FillValue", "coordinates", "_nc4_non_coord_a", "units", "base_x", "Fx [mN]"),
    *("\0", "é"),
]
LINES = [
    *(f"# {name or 'a'}: {value}" for name in NAMES for value in ("1", "a")),
    *(f"# run: {cell}" for cell in CELLS),
    *(f"# {name}: 1 [{unit}]" for name in ("rod_length", "load_cell_force_noise") for unit in UNITS),
    *(
        f"# column {name}: {kind} [{unit}] words"
        for name in ("base_x", "note", "t")
        for kind in ("number", "text", "integer", "x")
        for unit in UNITS
    ),
    *(
        f'# {key}: "{text}"'
        for key in ("note", '"a\\u0000"', '"\\ud800"', "column note: text [m]")
        for text in ("\\u0000", "\\ud800", "a\\n\\u0085", "\\")
    ),
    *('# column "\\ud800": text', "sep=;", "#", "# units: SI", "# units: dimensionless", "# load_cell_frame: turning"),
    f"# tactile_bayes record, format {'9' * 5000}",
]


def base_files(folder):
    """Contents, and how each is read."""
    path = folder / "base.csv"
    texts = {"note": ["", " a ", "1,5", '"', "\r\n", "ß€😀"], "t": np.arange(6.0), "count": [1, 2, 3, 4, 5, 6]}
    for rod in (None, WIRE):
        write_record(make_record(columns(**texts), rod=rod, attrs={"operator": "me", "run": 5}), path)
        yield path.read_bytes(), {}
    units = b"sweep,direction,drive_angle,holding_moment,force_x,force_y,sample\n,,deg,N mm,mN,mN,\n"
    yield units + b"".join(b"0,forward,%d,%d.5,1,2,%c\n" % (50 + n, n, b"abcde"[n]) for n in range(5)), {"rod": WIRE}
    yield b"\n".join(RIG.read_bytes().splitlines()[:20]) + b"\n", RIG_OPTIONS


def encoded(text):
    return text.encode("utf-8", "surrogatepass")


def mutated(content, rng):
    """The content with one to three things wrong with it."""

    def pick(texts):
        return encoded(texts[int(rng.integers(len(texts)))])

    def replaced(pattern, text, count):
        return re.sub(pattern, lambda _: text, content, count=count)

    for _ in range(int(rng.integers(1, 4))):
        lines = content.split(b"\n")
        at, row = int(rng.integers(len(content) + 1)), int(rng.integers(len(lines)))
        cells = re.split(b"([,;])", lines[row])
        match int(rng.integers(12)):
            case 0:
                sign = pick(['"', "\0", "\r", "\n", ",", ";", "#", "\\", "\t", "é", "\ufeff"])
                content = content[:at] + sign + content[at:]
            case 1:
                content = content[:at] + rng.bytes(int(rng.integers(1, 4))) + content[at + 1 :]
            case 2:
                content = content[:at]
            case 3:
                content = b"\n".join([*lines[:row], pick(LINES), *lines[row:]])
            case 4:
                content = pick(LINES) + b"\n" + content
            case 5:
                content = b"\n".join([*lines[:row], *lines[row + 1 :]])
            case 6:
                content = b"\n".join([*lines[:row], lines[row], *lines[row:]])
            case 7 | 8:
                cells[2 * int(rng.integers((len(cells) + 1) // 2))] = pick(CELLS)
                content = b"\n".join([*lines[:row], b"".join(cells), *lines[row + 1 :]])
            case 9:
                content = replaced(rb"\[[^\]\n]*\]|\bdeg\b|\bmN\b", pick(UNITS), 1)
            case 10:
                content = replaced(rb"note|Temp|\bt\b|operator|sample|force_x", pick(NAMES), int(rng.integers(3)))
            case _:
                codec = ("utf-16", "latin-1", "cp1252", "utf-8-sig")[int(rng.integers(4))]
                content = content.decode("utf-8", "replace").encode(codec, "replace")
    return content


def outcome(content, options, folder):
    """What becomes of a file: "refused", or "read" and written again, the same."""
    path = folder / "mutated.csv"
    path.write_bytes(content)
    try:
        record = read_record(path, **options)
    except RecordError as error:
        is_clear = str(error).startswith(f"{path}: ") and len(str(error)) < 2000 and "\0" not in str(error)
        return "refused" if is_clear else str(error)
    for suffix in (".csv", ".nc"):
        again = folder / f"again{suffix}"
        write_record(record, again)
        back = read_record(again)
        record.attrs.pop("units_source", None)
        back.attrs.pop("units_source", None)
        assert back.reset_coords().identical(record.reset_coords())
    return "read"


def outcomes(cases, folder):
    rng = np.random.default_rng(cases)
    bases = list(base_files(folder))
    for number in range(cases):
        content, options = bases[number % len(bases)]
        yield outcome(mutated(content, rng), options, folder)


def test_a_nul_in_a_unit_is_shown_as_such(tmp_path):
    units = b"sweep,direction,drive_angle,holding_moment,force_x,force_y\n\0,,deg,N mm,mN,mN\n"
    path = tmp_path / "record.csv"
    path.write_bytes(units + b"0,forward,50,0.5,1,2\n")
    with pytest.raises(RecordError, match=r"line 2, column 'sweep' is in \[\\0\], but takes 1"):
        read_record(path, rod=WIRE)


@pytest.mark.parametrize("cases", [40, pytest.param(3000, marks=pytest.mark.slow)])
def test_mutated_files_are_refused_or_read_and_written_again(tmp_path, cases):
    found = Counter(outcomes(cases, tmp_path))
    assert set(found) == {"refused", "read"}
    assert min(found.values()) > cases / 10
