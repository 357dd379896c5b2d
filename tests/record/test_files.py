"""The files of a record: CSV and NetCDF."""

import hypothesis.strategies as st
import numpy as np
import pytest
import xarray as xr
from hypothesis import HealthCheck, example, given, settings
from hypothesis.extra import numpy as hnp

from helpers.record_tables import WIRE, columns
from helpers.refusals import refused
from tactile_bayes.errors import RecordError, RecordWarning
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record import CHANNELS, FRAMES, column_of, parsing, record_hash, rod_of, write_record
from tactile_bayes.rig import Rig, make_record, read_record

HEADER = "sweep,direction,drive_angle,holding_moment,force_x,force_y"
ROW = "0,forward,1.25,0.5,0.125,0.25"
NINES = "9" * 5000


def write_text(path, *lines):
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


finite = st.floats(allow_nan=False, allow_infinity=False)
words = st.text(st.characters(exclude_categories=("Cs",), exclude_characters="\0"), max_size=12)
names = st.text(st.characters(exclude_categories=("Cs", "Cc")), min_size=1, max_size=8).filter(
    lambda name: name.strip() == name and name.isprintable() and "/" not in name and name != "."
)


@st.composite
def records(draw):
    """Records with extreme numbers, odd words and names, missing channels, in SI or without dimension."""
    table = columns(
        base_x=np.full(6, draw(finite)),
        drive_angle=np.array(columns()["drive_angle"]) * draw(st.floats(0.1, 1.0)),
        truth_contact_x=draw(hnp.arrays(float, 6, elements=st.floats(allow_infinity=True, allow_nan=False))),
        truth_contact_y=np.where(np.arange(6) % 2, np.nan, 0.1),
        note=draw(st.lists(words, min_size=6, max_size=6)),
        count=draw(hnp.arrays(np.int64, 6)),
        whole=np.arange(6.0),
    )
    missing = draw(st.sets(st.sampled_from(CHANNELS), max_size=2))
    for name in CHANNELS:
        table[name] = np.full(6, np.nan) if name in missing else draw(hnp.arrays(float, 6, elements=finite))
    for name, (unit, long_name) in draw(st.dictionaries(names, st.tuples(words, words), max_size=3)).items():
        if name not in table and column_of(name) is None:
            table[name] = xr.DataArray(np.arange(6.0), dims="sample", attrs={"units": unit, "long_name": long_name})
    attrs = draw(st.dictionaries(names, words | st.floats(allow_nan=False) | st.integers(-(2**63), 2**63 - 1)))
    attrs = {name: value for name, value in attrs.items() if name != "units" and not name.startswith(("rod_", "load_"))}
    rod, frame = draw(st.sampled_from([None, WIRE, Rod(0.1, 1e-300)])), draw(st.sampled_from([None, *FRAMES]))
    return make_record(table, Rig(rod=rod, load_cell=LoadCell(frame=frame)), attrs=attrs)


def awkward_record():
    """One of the worst that `records` may draw."""
    tiny, huge = 5e-324, 1.7976931348623157e308
    time = xr.DataArray(np.arange(6.0), dims="sample", attrs={"units": '] "s', "long_name": "12"})
    table = columns(
        holding_moment=[tiny, -tiny, huge, -huge, -0.0, 0.1 + 0.2],
        force_x=[np.nan] * 6,
        truth_contact_x=[np.nan, np.inf, -np.inf, -0.0, tiny, 1 / 3],
        count=np.array([-(2**63), 2**63 - 1, 0, 1, -1, 2]),
        note=["", " a ", "1,5", '"', "\r\n", "ß€😀"],
        digits=["1", "02", "nan", "", "-inf", "1e3"],
        note_length=np.arange(6.0),
        note1=["a", "bc", "", "d", "e", "f"],
        note2=["a"] * 6,
        sample=["a", "a", "", "b", "c", "d"],
        **{"1": ["x"] * 6},
        **{'key: "x" [m], #': time},
    )
    attrs = {"a: b": "1.0", "empty": "", "padded": " a,", "lines": "a\r\nb\u2028c", "run": 2**63 - 1, "limit": np.inf}
    return make_record(table, Rig(rod=WIRE), attrs=attrs)


@pytest.mark.parametrize("suffix", [".csv", ".nc"])
@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@example(record=awkward_record())
@given(record=records())
def test_a_file_loses_nothing(tmp_path, suffix, record):
    write_record(record, tmp_path / f"record{suffix}")
    back = read_record(tmp_path / f"record{suffix}")
    assert back.identical(record)
    assert {name: back[name].dtype.kind for name in back} == {name: record[name].dtype.kind for name in record}
    assert [*map(type, back.attrs.values())] == [*map(type, record.attrs.values())]
    for name in record:  # bits, so that the sign of zero counts
        if record[name].dtype.kind == "f":
            present = ~np.isnan(record[name].values)
            assert back[name].values[present].tobytes() == record[name].values[present].tobytes()
    assert record_hash(back) == record_hash(record)


@pytest.mark.parametrize("suffix", [".csv", ".nc"])
def test_what_is_written_is_read_as_it_was(tmp_path, suffix, monkeypatch):
    """Modes of a traced rod, coordinates, which become columns, and remarks of very different length, as objects."""
    path = tmp_path / f"record{suffix}"
    modes = (lambda s: 3.0 - 30.0 * s, lambda s: np.cos(60.0 * s))
    rod = Rod(0.1, 1e-4, rest_curvature=2.0, taper=0.3, rest_shape_modes=modes, taper_deviation=0.01)
    write_record(make_record(columns(), Rig(rod)), path)
    assert rod_of(read_record(path)) == rod
    timed = make_record(columns(time=np.arange(6.0)))
    write_record(timed.set_coords("time"), path)
    assert read_record(path).identical(timed)
    monkeypatch.setattr(parsing, "FREE", 100)
    record = make_record(columns(note=np.array(["", "a,b", "", "x" * 100, "", "a,b"], dtype=object)))
    assert [record[name].dtype.kind for name in ("note", "direction")] == ["O", "U"]
    write_record(record, path)
    assert read_record(path).identical(record)


@pytest.mark.parametrize(
    ("text", "value"),
    [*((text, text) for text in ("2024-05-01", "1, 2 and 3", NINES)), ('"4711"', "4711"), (f"{'0' * 5000}7", 7)],
)
def test_remarks_are_kept(tmp_path, text, value):
    name = "run" if value in (NINES, 7) else "load_cell_model"
    path = write_text(tmp_path / "lab.csv", f"# {name}: {text}", f"{HEADER},tag", f"{ROW},{NINES}")
    record = read_record(path)
    assert record.attrs[name] == value
    assert record["tag"].values.tolist() == [np.inf]
    write_record(record, path)
    assert read_record(path).identical(record)


@pytest.mark.parametrize("end", [",", ",,", ", "])
def test_separators_at_the_end_of_every_line_make_no_columns(tmp_path, end):
    plain = read_record(write_text(tmp_path / "plain.csv", HEADER, ROW, ROW))
    path = write_text(tmp_path / "rig.csv", HEADER + end, ROW + end, ROW + end)
    assert read_record(path).identical(plain)
    cells = end.replace(",", ",7", 1)
    write_text(path, HEADER + end, ROW + end, ROW + cells)
    with refused(RecordError, "line 1", "column 7", "line 3", "'7"):
        read_record(path)
    write_text(path, HEADER + end, ROW)
    with refused(RecordError, "columns (sweep, direction, drive_angle, holding_moment, force_x, force_y, (column 7)"):
        read_record(path)


def test_names_that_are_only_values_make_no_line_of_names(tmp_path):
    """What is given for all samples stands in lines of samples too."""
    path = write_text(tmp_path / "rig.csv", "Angle,Sense", "1.25,forward")
    with refused(RecordError, "column 'holding_moment'", "(columns: Angle, Sense)"):
        read_record(path, Rig(file={"drive_angle": "1.25-Angle", "sweep": "0", "direction": "forward"}))
    with refused(RecordError, "no column 'drive_angle'", "a column 'Angle'"):
        read_record(path, Rig(file={"sweep": "0", "direction": "forward"}))


@pytest.mark.parametrize("name", ["t", "index"])
def test_the_one_dimension_of_a_netcdf_file_may_have_any_name(tmp_path, name):
    record = make_record(columns(), Rig(rod=WIRE))
    record.rename_dims(sample=name).to_netcdf(tmp_path / "rig.nc", engine="h5netcdf")
    assert read_record(tmp_path / "rig.nc").identical(record)
    timed = record.rename_dims(sample=name).assign_coords({name: np.arange(6.0)})
    timed.to_netcdf(tmp_path / "rig.nc", engine="h5netcdf")
    assert read_record(tmp_path / "rig.nc")[name].values.tolist() == list(range(6))


def test_netcdf_holds_text_as_characters_and_no_objects(tmp_path):
    write_record(make_record(columns()), tmp_path / "record.nc")
    with xr.open_dataset(tmp_path / "record.nc", engine="h5netcdf", decode_cf=False) as stored:
        assert stored["direction"].dtype == "S1"
        assert all(variable.dtype != object for variable in stored.variables.values())


def test_a_file_without_header_is_dimensionless_without_a_rod_and_si_with_one(tmp_path):
    path = write_text(tmp_path / "plain.csv", HEADER, ROW)
    record = read_record(path)
    assert (record.attrs["units"], record.attrs["units_source"]) == ("dimensionless", "assumed")
    assert "units_source" not in read_record(path, Rig(rod=Rod())).attrs
    with pytest.warns(RecordWarning, match="force_x and force_y: .* rad, N m, N and N"):
        record = read_record(path, Rig(rod=WIRE))
    assert (record.attrs["units"], rod_of(record)) == ("SI", WIRE)
    assert "units_source" not in record.attrs
    path = write_text(tmp_path / "lab.csv", "# units: SI", "# rod_length: 0.2 [m]", HEADER, ROW)
    with refused(RecordError, path, "rod_flexural_rigidity", "Rod(length=..., flexural_rigidity=...)", "[rod]"):
        read_record(path)
    assert rod_of(read_record(path, Rig(rod=WIRE))) == WIRE


@pytest.mark.parametrize("suffix", [".csv", ".nc"])
def test_a_given_rod_completes_or_repeats_the_stated_one(tmp_path, suffix):
    path = tmp_path / f"record{suffix}"
    write_record(make_record(columns(), Rig(rod=WIRE)), path)
    assert rod_of(read_record(path, Rig(rod=WIRE))) == WIRE
    with refused(RecordError, f"{path}: the SI record states {WIRE}, but {Rod(0.1, 1e-5)} was given"):
        read_record(path, Rig(rod=Rod(0.1, 1e-5)))
    write_record(make_record(columns()), path)
    with refused(RecordError, f"but {WIRE} was given"):
        read_record(path, Rig(rod=WIRE))


@pytest.mark.parametrize(
    ("lines", "named"),
    [
        ([HEADER, ROW, "", ROW.replace("0.125", "oops")], ["line 4, column 'force_x'", "'oops'"]),
        (["# note", HEADER, ROW, ROW.replace("0.125", "")], ["line 4, column 'force_x'", "nan"]),
        ([HEADER + ",note", ROW + ',"two\nlines"', ROW.replace("0.5", "x") + ","], ["line 4, column 'holding_moment'"]),
        ([HEADER, ROW, ROW.replace("1.25", "1.0")], ["1.25 rad (line 2)", "1.0 rad (line 3)"]),
        ([HEADER, "0,forward,1,25,0,5,0,125"], ["line 2", "8 cells", "6 columns"]),
        ([HEADER.replace(",", ";"), "0;forward;1.25;0,5;0;0"], ["'0,5'"]),
        ([HEADER.replace(",", " "), ROW.replace(",", " ")], ["'sweep'", "(columns: sweep direction drive_angle"]),
        ([HEADER.replace(",", ";"), "0;forward;1,25;1.000,5;0;0"], ["line 2, column 'holding_moment'", "'1.000,5'"]),
        (["," + HEADER, "7," + ROW], ["line 1", "column 1", "line 2", "'7'"]),
        (["Rig 4", HEADER, ROW], ["line 1", "(Rig 4)", "in line 2"]),
        (["# note", "Rig 4,,,,,", HEADER, ROW], ["line 2", "(Rig 4)", "in line 3"]),
        (["Rig 4", "Angle,Fx", "1.0,2.0"], ["line 1", "(Rig 4)", "more cells", "#"]),
        ([HEADER + ",force_x", ROW + ",1"], ["line 1", "two columns 'force_x'"]),
        (["# tactile_bayes record, format 2", HEADER, ROW], ["line 1", "format 2"]),
        (["# units: SI", "# units: SI", HEADER, ROW], ["line 2", "'units'", "second time"]),
        (["# units: SI", "# rod_length: 200 [mN]", HEADER, ROW], ["line 2", "rod_length", "[mN]", "m, cm, mm or"]),
        (["# units: SI", "# rod_length: long", HEADER, ROW], ["line 2", "rod_length", "'long'"]),
        (["# units: dimensionless", "# load_cell_lag: 0.1 [m]", HEADER, ROW], ["line 2", "load_cell_lag", "takes 1"]),
        (["# column time: clock [s]", HEADER, ROW], ["line 1", "'clock'", "no kind"]),
        (["# column n: integer [1]", HEADER + ",n", ROW + ",1.5"], ["line 3, column 'n'", "'1.5'"]),
        (
            ["# column drive_angle: number [mm]", HEADER, ROW],
            ["line 1, column 'drive_angle'", "[mm]", "rad, mrad, deg or"],
        ),
        (["# units: dimensionless", "# column force_x: number [mN]", HEADER, ROW], ["line 2, column 'force_x'", "[1]"]),
        (["# units: SI"], ["no line of"]),
        ([HEADER], ["no samples"]),
        ([HEADER, ROW.replace("1.25", '"1,25"')], ["line 2, column 'drive_angle'", "'1,25'"]),
        ([HEADER.replace("drive_angle", "x") + ",a/b,a|b", ROW + ",1,2"], ["no column 'drive_angle'"]),
        ([HEADER, ROW + '"' + "x" * 200_000], ["line 2", "cannot be read"]),
        (["# load_cell_bias_fx: 12.5 [mN]", HEADER, ROW], ["line 1", "'12.5 [mN]'", "'bias_force_x'"]),
        (["# load_cell_bias_fx: 0,0125", HEADER, ROW], ["line 1", "'load_cell_bias_fx'", "'0,0125'"]),
        (["# load_cell_serial: 4711", HEADER, ROW], ["line 1", "not begin with 'load_cell_'"]),
        (["# load_cell_force_noise: -1", HEADER, ROW], ["line 1", "'load_cell_force_noise'", "-1.0"]),
        ([HEADER, ROW.replace("0,", f"{NINES},", 1)], ["line 2, column 'sweep'"]),
        ([f"# rod_length: 1 [{'Gm9 ' * 40}]", HEADER, ROW], ["line 1", "rod_length", "[Gm9"]),
        ([f"{HEADER},note", f"{ROW},a\0b"], ["line 2", "NUL", "0x00"]),
        (["# note: a\0b", HEADER, ROW], ["line 1", "NUL", "0x00"]),
        (['# note: "a\\u0000"', HEADER, ROW], ["line 1, attribute 'note'", "NUL", "0x00"]),
        (['# note: "\\ud800"', HEADER, ROW], ["line 1, attribute 'note'", "surrogate"]),
        (['# column note: text [m] "\\ud800"', f"{HEADER},note", f"{ROW},a"], ["line 1, column 'note'", "surrogate"]),
        (["# CLASS: 1", HEADER, ROW], ["'CLASS'", "cannot be stored"]),
        ([f"{HEADER},{'x' * 201}", f"{ROW},a"], ["cannot be stored"]),
        ([f"# tactile_bayes record, format {NINES}", HEADER, ROW], ["line 1", "has format"]),
    ],
)
def test_what_is_wrong_in_a_csv_file_is_refused_with_its_line(tmp_path, lines, named):
    path = write_text(tmp_path / "bad.csv", *lines)
    with refused(RecordError, *named) as caught:
        read_record(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert len(str(caught.value)) < 2000


def test_files_that_are_something_else_are_refused(tmp_path):
    record = make_record(columns())
    (tmp_path / "a.nc").write_bytes(b"not a file of this kind")
    xr.Dataset({"image": ("pixel", [1.0]), "sweep": ("t", [0])}).to_netcdf(tmp_path / "b.nc", engine="h5netcdf")
    for name in ("folder", "folder.csv"):
        (tmp_path / name).mkdir()
    for name in ("a.txt", "a"):
        write_text(tmp_path / name, HEADER, ROW)
        with refused(RecordError, ".csv", ".nc", name):
            write_record(record, tmp_path / name)
    for name, named in (
        ("a.nc", ["a.nc", "cannot be read"]),
        ("b.nc", ["variable 'image' has dimensions ('pixel',)"]),
        ("a.txt", [".csv", ".nc", "a.txt"]),
        ("a", [".csv", ".nc", "a"]),
        *((name, [f"{tmp_path / name} is a folder"]) for name in ("folder", "folder.csv")),
    ):
        with refused(RecordError, *named):
            read_record(tmp_path / name)
    for name in ("absent.csv", "absent.nc", "absent"):
        with pytest.raises(FileNotFoundError):
            read_record(tmp_path / name)


@pytest.mark.parametrize(
    ("content", "named"),
    [
        (f"{HEADER}\n{ROW}".encode("utf-16"), ["UTF-16", "first bytes"]),
        (b"\xfe\xff" + HEADER.encode("utf-16-be"), ["UTF-16"]),
        (HEADER.encode("utf-32"), ["UTF-32"]),
        (HEADER.encode("utf-16-le"), ["looks like UTF-16"]),
        (b"\x89HDF\r\n\x1a\n", ["NetCDF (HDF5)"]),
        (b"CDF\x01\x00", ["NetCDF", "classic"]),
        (b"PK\x03\x04\x14", ["zip archive"]),
    ],
)
def test_a_file_that_is_no_csv_file_says_what_it_is(tmp_path, content, named):
    (tmp_path / "a.csv").write_bytes(content)
    with refused(RecordError, "a.csv", *named):
        read_record(tmp_path / "a.csv")


def test_what_cannot_be_written_is_refused_before_there_is_a_file(tmp_path):
    with refused(RecordError, "there is no column 'force_x'"):
        write_record(make_record(columns()).drop_vars("force_x"), tmp_path / "a.csv")
    assert list(tmp_path.iterdir()) == []
    for text in ("a\0b", "\ud800", "x" * 131_073):
        with refused(RecordError, "sample 1, column 'note'"):
            make_record(columns(note=["", text, "", "", "", ""]))
