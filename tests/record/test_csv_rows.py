"""The rows of a CSV file: odd cells, pieces, memory."""

import subprocess
import sys
from pathlib import Path

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from helpers.refusals import refused
from tactile_bayes.errors import RecordError
from tactile_bayes.record import csv_rows
from tactile_bayes.record.csv_format import read_csv
from tactile_bayes.record.parsing import integer_in, number_in

TESTS = Path(__file__).parents[1]
USUAL = {
    "sweep": ["0", "1"],
    "direction": ["forward", "backward"],
    "drive_angle": ["0.5", "1.25", "-0.1"],
    "force_x": ["0.1234567890123456789", "", "1e-3", "7"],
    "note": ["a", "", "run 1"],
    "count": ["1", "20"],
}
ODD = [
    *("nan", "inf", "-0", "+3", " 7 ", "2.0", "5.", ".5", "1e400", "9007199254740993", "9223372036854775808", "1e30"),
    *("1_0", "x", "0x10", "1d3", "١", "1 2", "--1", "1e", "true", "", " ", "1,5", "1.000,5", "\0", "µ", " forward "),
    *('"q,r;s\tt"', '"x""y"', '5" pipe', '"two\nlines"', '"lone\rreturn"', '"windows\r\nline"', '"open'),
]


@st.composite
def tables(draw):
    """Lines of a file in which here and there something is odd."""
    delimiter = draw(st.sampled_from(",,;\t"))
    comma = delimiter != "," and draw(st.booleans())
    is_odd = st.sampled_from([False] * 29 + [True]) if draw(st.booleans()) else st.just(False)
    lines = [delimiter.join(USUAL)]
    for _ in range(draw(st.integers(1, 25))):
        cells = [draw(st.sampled_from(ODD if draw(is_odd) else usual)) for usual in USUAL.values()]
        if comma:
            cells[2:4] = (cell.replace(".", ",") for cell in cells[2:4])
        if draw(is_odd):
            cells = draw(st.sampled_from([[], cells[:-1], [*cells, "1"]]))
        lines.append(delimiter.join(cells))
    end = draw(st.sampled_from(["\n", "\r\n"]))
    return end.join(lines) + draw(st.sampled_from(["", end]))


def outcome(path):
    """Types, bits and lines of a table, or its refusal."""
    try:
        table = read_csv(path, {})
    except RecordError as error:
        return str(error)
    columns = {name: (values.dtype.kind, values.tolist()) for name, (values, _) in table.columns.items()}
    return repr(columns), list(table.source.lines)


@settings(max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(table=tables())
def test_a_file_is_the_same_in_pieces_as_whole(tmp_path, table):
    path = tmp_path / "record.csv"
    path.write_bytes(table.encode())
    whole = outcome(path)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(csv_rows, "_ROWS", 3)
        in_pieces = outcome(path)
    # of several refusals it depends on the pieces which one comes first
    assert in_pieces == whole or (isinstance(whole, str) and isinstance(in_pieces, str))


@pytest.mark.parametrize("cell", ODD[:21])
def test_a_cell_among_usual_ones_is_what_it_is_alone(tmp_path, cell):
    """Columns of usual cells are converted at once, others cell by cell."""
    path = tmp_path / "record.csv"
    for name, parsed, usual in (("sweep", integer_in(cell), "1"), ("force_x", number_in(cell), "0.5")):
        path.write_text(f"{name},note\n{usual},a\n{cell},a\n", encoding="utf-8")
        if parsed is None:
            with refused(RecordError, f"line 3, column {name!r}: {cell!r}"):
                read_csv(path, {})
        else:
            assert repr(read_csv(path, {}).columns[name][0].tolist()[1]) == repr(parsed)


READING = """
import sys
from helpers.memory import own_peak
from tactile_bayes.rig import read_record

read_record(sys.argv[2])  # what reading loads
before = own_peak()
record = read_record(sys.argv[1])
print(own_peak() - before, record.sizes["sample"])
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="memory is counted otherwise there")
def test_a_file_is_read_in_less_memory_than_four_times_its_size(tmp_path):
    """Few digits, so that a record is much larger than its share of the file. Larger files take relatively less."""
    samples, sweeps = 10_000, 80
    rng = np.random.default_rng(1)
    lines = [
        f"{1 + k / samples:.4f},{a:.4f},{b:.3f},{c:.3f}" for k, (a, b, c) in enumerate(rng.normal(size=(samples, 3)))
    ]
    path = tmp_path / "record.csv"
    with open(path, "w", encoding="utf-8") as file:
        file.write("sweep,direction,drive_angle,holding_moment,force_x,force_y,note\n")
        for sweep in range(sweeps):
            file.writelines(f"{sweep},forward,{line},\n" for line in lines)
        file.write(f"{sweeps - 1},forward,3,0,0,0,{'a long remark ' * 1000}\n")
    first = tmp_path / "first.csv"
    first.write_text("sweep,direction,drive_angle,holding_moment,force_x,force_y\n0,forward,1,0,0,0\n")
    command = [sys.executable, "-c", READING, path, first]
    done = subprocess.run(command, cwd=TESTS, capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stderr
    peak, read = map(int, done.stdout.split())
    assert read == samples * sweeps + 1
    assert peak < 4 * path.stat().st_size
