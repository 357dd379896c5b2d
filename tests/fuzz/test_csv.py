"""Mutated CSV files: each is refused in words of our own, or is read as it was meant, and can be written again."""

import re
import time
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from helpers.mutations import pick
from helpers.record_tables import WIRE, columns
from tactile_bayes.errors import RecordError, RecordWarning
from tactile_bayes.record import write_record
from tactile_bayes.rig import Rig, make_record, read_record

RIG = Path(__file__).parents[2] / "data" / "synthetic" / "rig.csv"
OF_FILE = {"drive_angle": "90-Angle[deg]", "holding_moment": "Mz", "force_x": "Fx[mN]", "force_y": "Fy"}

LIMIT = 2.0  # longest processor time of a reading [s]
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
        write_record(make_record(columns(**texts), Rig(rod=rod), attrs={"operator": "me", "run": 5}), path)
        yield path.read_bytes(), Rig()
    units = b"sweep,direction,drive_angle,holding_moment,force_x,force_y,sample\n,,deg,N mm,mN,mN,\n"
    yield units + b"".join(b"0,forward,%d,%d.5,1,2,%c\n" % (50 + n, n, b"abcde"[n]) for n in range(5)), Rig(WIRE)
    yield b"\n".join(RIG.read_bytes().splitlines()[:20]) + b"\n", Rig(WIRE, file={**OF_FILE, "split_sweeps": True})


def mutated(content, rng):
    """The content with one to three things wrong with it."""

    def one_of(texts):
        return pick(rng, texts).encode("utf-8", "surrogatepass")

    def replaced(pattern, text, count):
        return re.sub(pattern, lambda _: text, content, count=count)

    for _ in range(int(rng.integers(1, 4))):
        lines = content.split(b"\n")
        at, row = int(rng.integers(len(content) + 1)), int(rng.integers(len(lines)))
        cells = re.split(b"([,;])", lines[row])
        match int(rng.integers(12)):
            case 0:
                sign = one_of(['"', "\0", "\r", "\n", ",", ";", "#", "\\", "\t", "é", "\ufeff"])
                content = content[:at] + sign + content[at:]
            case 1:
                content = content[:at] + rng.bytes(int(rng.integers(1, 4))) + content[at + 1 :]
            case 2:
                content = content[:at]
            case 3:
                content = b"\n".join([*lines[:row], one_of(LINES), *lines[row:]])
            case 4:
                content = one_of(LINES) + b"\n" + content
            case 5:
                content = b"\n".join([*lines[:row], *lines[row + 1 :]])
            case 6:
                content = b"\n".join([*lines[:row], lines[row], *lines[row:]])
            case 7 | 8:
                cells[2 * int(rng.integers((len(cells) + 1) // 2))] = one_of(CELLS)
                content = b"\n".join([*lines[:row], b"".join(cells), *lines[row + 1 :]])
            case 9:
                content = replaced(rb"\[[^\]\n]*\]|\bdeg\b|\bmN\b", one_of(UNITS), 1)
            case 10:
                content = replaced(rb"note|Temp|\bt\b|operator|sample|force_x", one_of(NAMES), int(rng.integers(3)))
            case _:
                codec = pick(rng, ("utf-16", "latin-1", "cp1252", "utf-8-sig"))
                content = content.decode("utf-8", "replace").encode(codec, "replace")
    return content


def read(content, rig, folder):
    """The record of a file and what is noted about it, or the refusal and no notes; either in time."""
    path = folder / "record.csv"
    path.write_bytes(content)
    began, is_clear = time.thread_time(), True
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", RecordWarning)
        try:
            record = read_record(path, rig)
        except RecordError as error:
            record, said = error, str(error)
            is_clear = said.startswith(f"{path}: ") and len(said) < 2000 and "\0" not in said
    assert is_clear, record
    assert time.thread_time() - began < LIMIT
    return record, [str(one.message) for one in caught]


def outcome(content, rig, folder):
    """What becomes of a file: "refused", or "read" and written again, the same."""
    record, _ = read(content, rig, folder)
    if isinstance(record, RecordError):
        return "refused"
    for suffix in (".csv", ".nc"):
        again = folder / f"again{suffix}"
        write_record(record, again)
        back = read_record(again)
        record.attrs.pop("units_source", None)
        back.attrs.pop("units_source", None)
        assert back.reset_coords().identical(record.reset_coords())
    return "read"


def test_a_nul_in_a_unit_is_shown_as_such(tmp_path):
    units = b"sweep,direction,drive_angle,holding_moment,force_x,force_y\n\0,,deg,N mm,mN,mN\n"
    error, _ = read(units + b"0,forward,50,0.5,1,2\n", Rig(rod=WIRE), tmp_path)
    assert all(word in str(error) for word in ("line 2", "'sweep'", r"[\0]", "takes 1"))


@pytest.mark.parametrize("cases", [16, pytest.param(600, marks=pytest.mark.slow)])
def test_mutated_files_are_refused_or_read_and_written_again(tmp_path, fuzz_seed, cases):
    rng = np.random.default_rng(fuzz_seed)
    bases = list(base_files(tmp_path))
    found = Counter()
    for number in range(cases):
        content, rig = bases[number % len(bases)]
        found[outcome(mutated(content, rng), rig, tmp_path)] += 1
    if cases > 100:
        assert min(found["refused"], found["read"]) > cases / 20


# --- Files that mean the same ---------------------------------------------------------------------------------------

NAMES_OF = {"drive_angle": "Angle", "holding_moment": "Mz", "force_x": "Fx", "force_y": "Fy"}
SPELLINGS = {
    "drive_angle": ("deg", "°", "\N{MASCULINE ORDINAL INDICATOR}", "\N{RING ABOVE}", "degrees"),
    "holding_moment": ("N mm", "Nmm", "mN·m", "mN\N{DOT OPERATOR}m", "N\N{MULTIPLICATION SIGN}mm", "N*mm"),
    "force_x": ("mN", "mN", "m\N{FULLWIDTH LATIN CAPITAL LETTER N}"),
    "force_y": ("mN", "\N{ZERO WIDTH SPACE}mN"),
}
WRONG = {
    "drive_angle": ("rad", "mrad", "kg", "mm"),
    "holding_moment": ("N m", "mN", "kg", "Nm", "lbf"),
    "force_x": ("N", "kg", "\N{MICRO SIGN}N", "N m", "counts"),
    "force_y": ("N", "gf", "kg", "V"),
}
SIZES = {"drive_angle": np.pi / 180, "holding_moment": 1e-3, "force_x": 1e-3, "force_y": 1e-3}
LINES_ABOVE = ["# rodent: 7", "# serial: 4711", "# made on Monday, see log", "# load_cell_model: ATI Nano17"]
LINES_ABOVE += ["#", "# a = b"]


class WrittenTable:
    """A file of a rig, and how it is read: names, units in one place, cells, signs."""

    def __init__(self, rng):
        self.rng = rng
        rows = int(rng.integers(12, 16))
        self.values = {
            "drive_angle": np.sort(rng.uniform(20.0, 160.0, rows)).round(4),
            "holding_moment": rng.normal(0.0, 40.0, rows).round(4),
            "force_x": rng.normal(0.0, 2000.0, rows).round(4),
            "force_y": rng.normal(0.0, 300.0, rows).round(4),
        }
        self.delimiter, self.decimal = self.pick([(",", "."), (";", "."), (";", ","), ("\t", ",")])
        self.units = {name: self.pick(SPELLINGS[name]) for name in NAMES_OF}
        self.place = self.pick(["name", "row", "header", "option"])
        self.above = [self.pick(LINES_ABOVE) for _ in range(int(rng.integers(3)))]
        self.cells = [
            [f"{value:.4f}".replace(".", self.decimal) for value in row]
            for row in zip(*self.values.values(), strict=True)
        ]

    def pick(self, choices):
        return pick(self.rng, choices)

    @property
    def columns(self):
        given = self.units if self.place == "option" else {}
        return {name: f"{own}[{given[name]}]" if name in given else own for name, own in NAMES_OF.items()}

    @property
    def lines(self):
        names, below, above = list(NAMES_OF.values()), [], list(dict.fromkeys(self.above))
        if self.place == "name":
            names = [f"{own} [{self.units[name]}]" for name, own in NAMES_OF.items()]
        if self.place == "row":
            below = [self.delimiter.join(self.units.values())]
        if self.place == "header":
            above += [f"# column {own}: number [{self.units[name]}]" for name, own in NAMES_OF.items()]
        return [*above, self.delimiter.join(names), *below, *map(self.delimiter.join, self.cells)]

    @property
    def content(self):
        return ("\n".join(self.lines) + "\n").encode()

    def read(self, content, folder, columns=None):
        """The record and its notes, or the refusal and no notes."""
        return read(content, Rig(WIRE, file={**(columns or self.columns), "split_sweeps": True}), folder)

    def differing(self, record):
        """The rows of a record that differ from those of the table."""
        assert record.sizes["sample"] <= len(self.cells)
        count = record.sizes["sample"]
        right = np.array([self.values[name][:count] * SIZES[name] for name in NAMES_OF])
        return np.flatnonzero(~np.isclose([record[name] for name in NAMES_OF], right, rtol=1e-12, atol=0.0).all(axis=0))


MINUS = ("\N{MINUS SIGN}", "\N{EN DASH}", "\N{FULLWIDTH HYPHEN-MINUS}", "\N{NON-BREAKING HYPHEN}")
BLANKS = (" ", "\N{NO-BREAK SPACE}", "\N{THIN SPACE}", "\N{NARROW NO-BREAK SPACE}", "\N{ZERO WIDTH SPACE}")


def with_cells(rig, change):
    """The content with each cell changed."""
    rig.cells = [[change(cell) for cell in row] for row in rig.cells]
    return rig.content


def other_signs(rig):
    minus = rig.pick(MINUS)
    return with_cells(rig, lambda cell: cell.replace("-", minus))


def other_digits(rig):
    begin = ord(rig.pick("\N{FULLWIDTH DIGIT ZERO}\N{ARABIC-INDIC DIGIT ZERO}"))
    digits = {ord("0") + k: chr(begin + k) for k in range(10)}
    return with_cells(rig, lambda cell: cell.translate(digits))


def thousands(rig):
    blank = rig.pick(BLANKS[1:4])
    return with_cells(rig, lambda cell: re.sub(r"(?<=\d)(?=\d{3}[.,])", blank, cell))


def padded(rig):
    blank = rig.pick(BLANKS)
    return with_cells(rig, lambda cell: f"{blank}{cell}{blank}")


def odd_names(rig):
    blank = rig.pick(["\N{ZERO WIDTH SPACE}", "\N{ZERO WIDTH NO-BREAK SPACE}", "\N{WORD JOINER}"])
    rig.place = rig.pick(["name", "row", "option"])
    return rig.content.replace(b"Fx", f"{blank}F{blank}x".encode()).replace(b" [", "\N{NO-BREAK SPACE}[".encode())


def other_ends(rig):
    return rig.content.replace(b"\n", rig.pick([b"\r\n", b"\r"]))


def other_encoding(rig):
    rig.units = {"drive_angle": "°", "holding_moment": "N·mm", "force_x": "mN", "force_y": "mN"}
    return rig.content.decode().encode(rig.pick(["utf-8-sig", "cp1252"]))


def no_end(rig):
    return rig.content[:-1]


def empty_column(rig):
    return re.sub(rb"^([^#].*)$", rb"\1" + rig.delimiter.encode(), rig.content, flags=re.MULTILINE)


SAME = [other_signs, other_digits, thousands, padded, odd_names, other_ends, other_encoding, no_end, empty_column]


@pytest.mark.parametrize("change", SAME)
def test_a_file_that_means_the_same_is_read_as_the_same(tmp_path, fuzz_seed, change):
    rng = np.random.default_rng([fuzz_seed, SAME.index(change)])
    for _ in range(6):
        rig = WrittenTable(rng)
        record, notes = rig.read(change(rig), tmp_path)
        assert not isinstance(record, RecordError), (record, rig.lines)
        assert record.sizes["sample"] == len(rig.cells)
        assert not rig.differing(record).size, rig.lines
        assert len(notes) == (change is no_end), notes


# --- Files with a fault ---------------------------------------------------------------------------------------------

KNOWN = ("rod_taper", "rod_rest_curvature", "rod_diameter", "rod_stem", "load_cell_force_noise", "load_cell_frame")


def misspelt(rig):
    """An attribute of the rod or the load cell with a letter too many, too few, other or exchanged, or other signs."""
    name = rig.pick(KNOWN)
    at = int(rig.rng.integers(len(name) - 1))
    other = rig.pick(
        [
            name[:at] + name[at + 1 :],
            name[:at] + name[at] + name[at:],
            name[:at] + "q" + name[at + 1 :],
            name[:at] + name[at + 1] + name[at] + name[at + 2 :],
            name.replace("_", rig.pick(["-", ".", "", "__"])),
            rig.pick([name.upper(), name.title()]),
        ]
    )
    value = "turning" if name.endswith("frame") else rig.pick(["0.4", "0,4", "0.4 mm", "4e-1 [m]"])
    sign = rig.pick([": ", " = ", "; ", "\t", ", ", ":"]) if other != name else " = "
    return f"# {other}{sign}{value}\n".encode() + rig.content


def contradicting_units(rig):
    """Two units of one column that are not the same."""
    rig.place = rig.pick(["name", "row", "header"])
    name = rig.pick(list(NAMES_OF))
    own, wrong = NAMES_OF[name], rig.pick(WRONG[name])
    places = {
        "name": rig.content.replace(own.encode(), f"{own} [{wrong}]".encode()),
        "header": f"# column {own}: number [{wrong}]\n".encode() + rig.content,
    }
    return places[rig.pick([place for place in places if place != rig.place])]


@pytest.mark.parametrize("fault", [misspelt, contradicting_units])
def test_a_file_with_a_fault_is_refused(tmp_path, fuzz_seed, fault):
    rng = np.random.default_rng([fuzz_seed, len(fault.__name__)])
    for _ in range(30):
        rig = WrittenTable(rng)
        content = fault(rig)
        record, _ = rig.read(content, tmp_path)
        assert isinstance(record, RecordError), content.decode()


def test_a_unit_that_contradicts_the_file_is_refused(tmp_path, fuzz_seed):
    rng = np.random.default_rng([fuzz_seed, 7])
    for _ in range(20):
        rig = WrittenTable(rng)
        rig.place = rig.pick(["name", "row", "header"])
        name = rig.pick(list(NAMES_OF))
        unit = rig.pick([unit for unit in WRONG[name] if unit not in ("kg", "lbf", "counts", "V")])
        record, _ = rig.read(rig.content, tmp_path, {**rig.columns, name: f"{NAMES_OF[name]}[{unit}]"})
        assert isinstance(record, RecordError), (unit, rig.lines)
        assert unit in str(record)


def test_an_angle_of_another_turn_is_refused_with_the_number_to_subtract(tmp_path, fuzz_seed):
    rng = np.random.default_rng([fuzz_seed, 8])
    for _ in range(10):
        rig = WrittenTable(rng)
        turns = int(rng.choice([-3, -2, 2, 3]))
        for row, angle in zip(rig.cells, rig.values["drive_angle"], strict=True):
            row[0] = f"{angle + 360 * turns:.4f}".replace(".", rig.decimal)
        columns = rig.columns | {"drive_angle": rig.pick(["", "0+"]) + rig.columns["drive_angle"]}
        record, _ = rig.read(rig.content, tmp_path, columns)
        assert isinstance(record, RecordError)
        advice = re.search(r"file=\{'drive_angle': '([^']*)'\}", str(record))[1]
        record, _ = rig.read(rig.content, tmp_path, {**columns, "drive_angle": advice})
        whole = 2.0 * np.pi * np.round((record["drive_angle"] - np.radians(rig.values["drive_angle"])) / (2.0 * np.pi))
        np.testing.assert_allclose(record["drive_angle"] - whole, np.radians(rig.values["drive_angle"]), atol=1e-9)


def test_a_file_that_is_cut_short_loses_no_more_than_its_last_row_and_says_so(tmp_path, fuzz_seed):
    rng = np.random.default_rng([fuzz_seed, 9])
    found = Counter()
    for _ in range(60):
        rig = WrittenTable(rng)
        content = rig.content
        last = content.rstrip(b"\n").rfind(b"\n") + 1
        cut = content[: int(rng.integers(last + 1, len(content)))] + b"\0" * int(rng.choice([0, 0, 0, 5]))
        record, notes = rig.read(cut, tmp_path)
        if isinstance(record, RecordError):
            found["refused"] += 1
            continue
        assert notes, cut
        found["kept" if record.sizes["sample"] == len(rig.cells) else "left out"] += 1
        assert not rig.differing(record).size, cut
    assert found["left out"] >= 1


def test_a_wrong_cell_changes_no_other_row(tmp_path, fuzz_seed):
    rng = np.random.default_rng([fuzz_seed, 10])
    found = Counter()
    for _ in range(40):
        rig = WrittenTable(rng)
        row, column = int(rng.integers(len(rig.cells))), int(rng.integers(1, 4))
        cell, at = rig.cells[row][column], int(rng.integers(5))
        edits = [rig.pick(CELLS), cell[:at] + rig.pick("-+.,e0 '\"#x") + cell[at:], cell[:at] + cell[at + 1 :]]
        rig.cells[row][column] = rig.pick(edits)
        content = ("\n".join(rig.lines) + "\n").encode("utf-8", "surrogatepass")
        record, _ = rig.read(content, tmp_path)
        found[type(record).__name__] += 1
        if not isinstance(record, RecordError):
            assert set(rig.differing(record)) <= {row}, content
    assert len(found) == 2
