"""Columns of a rig: names, units, factors, signs and zeros of its own."""

import numpy as np
import pytest
import xarray as xr

from helpers.record_tables import WIRE, columns
from helpers.refusals import refused
from tactile_bayes.errors import ParameterError, RecordError, RecordWarning
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record import rod_of, to_dimensionless, write_record
from tactile_bayes.record.origin import Origin, column_entry, origins_of
from tactile_bayes.record.table import Source
from tactile_bayes.rig import Rig, make_record, read_record


@pytest.mark.parametrize(
    ("text", "names", "origin"),
    [
        ("Fx", ["Fx"], Origin("Fx")),
        ("Fx[mN]", ["Fx"], Origin("Fx", "mN")),
        ("- Fx [mN]", ["Fx"], Origin("Fx", "mN", -1)),
        ("+Fx", ["Fx"], Origin("Fx")),
        ("90-Fx[mN]", ["Fx"], Origin("Fx", "mN", -1, 90.0)),
        ("-90+Fx[mN]", ["Fx"], Origin("Fx", "mN", 1, -90.0)),
        ("Fx[mN]+1.5", ["Fx"], Origin("Fx", "mN", 1, 1.5)),
        ("-Fx[mN]-1e-3", ["Fx"], Origin("Fx", "mN", -1, -1e-3)),
        ("Fx-360[mN]", ["Fx"], Origin("Fx", "mN", 1, -360.0)),
        ("90-Fx - 360 [mN]", ["Fx"], Origin("Fx", "mN", -1, -270.0)),
        ("Fx [mN]+360[mN]", ["Fx [mN]"], Origin("Fx [mN]", "mN", 1, 360.0)),
        ("Fx-1[mN]", ["Fx-1", "Fx"], Origin("Fx-1", "mN")),
        ("Fx_mN", ["Fx_mN"], Origin("Fx_mN", "mN")),
        ("Fx_mm", ["Fx_mm"], Origin("Fx_mm")),
        ("Fx[mN]", ["Fx [mN]"], Origin("Fx [mN]", "mN")),
        ("-Fx", ["Fx (mN)"], Origin("Fx (mN)", "mN", -1)),
        ("Fx", ["Fx / mN"], Origin("Fx / mN", "mN")),
        ("Fx (left)", ["Fx (left)", "Fx (right)"], Origin("Fx (left)")),
        ("Fx (left)[mN]", ["Fx (left)"], Origin("Fx (left)", "mN")),
        ("Fx [ch1][mN]", ["Fx [ch1]"], Origin("Fx [ch1]", "mN")),
        ("Fx", ["Fx [mN]", "Fx"], Origin("Fx")),
        ("Kraft längs [mN]", ["Kraft  längs"], Origin("Kraft  längs", "mN")),
        # Names may look like arithmetic: what is in the file comes first.
        ("F-1", ["F-1", "F"], Origin("F-1")),
        ("F-1", ["F"], Origin("F", None, 1, -1.0)),
        ("-F", ["-F", "F"], Origin("-F")),
        ("90-F", ["90-F"], Origin("90-F")),
        ("-F-1[N]", ["F-1"], Origin("F-1", "N", -1)),
        ("5", ["5"], Origin("5")),
        # Factors, and names that look like them.
        ("1e-3 * Fx [N]", ["Fx"], Origin("Fx", "N", factor=1e-3)),
        ("-0.5*Mz", ["Mz"], Origin("Mz", None, -1, factor=0.5)),
        ("90 - 0.1 * Angle [deg]", ["Angle"], Origin("Angle", "deg", -1, 90.0, factor=0.1)),
        ("2*Fx[mN]+1.5", ["Fx"], Origin("Fx", "mN", 1, 1.5, factor=2.0)),
        ("2*Fx", ["2*Fx", "Fx"], Origin("2*Fx")),
        ("-2*Fx[N]", ["2*Fx", "Fx"], Origin("2*Fx", "N", -1)),
        ("3*2*Fx", ["2*Fx", "Fx"], Origin("2*Fx", factor=3.0)),
        ("Fx*", ["Fx*", "Fx"], Origin("Fx*")),
        ("Fx*Fy", ["Fx*Fy"], Origin("Fx*Fy")),
    ],
)
def test_what_stands_for_a_column(text, names, origin):
    assert origins_of({"force_x": text}, names, Source())["force_x"] == origin


@pytest.mark.parametrize(
    ("target", "text", "origin"),
    [
        ("sweep", "3", Origin("", value=3)),
        ("direction", "forward", Origin("", value="forward")),
        ("base_x", "-12[mm]", Origin("", "mm", value=-12.0)),
        ("base_y", "0", Origin("", value=0.0)),
        ("direction", "Sense", Origin("Sense")),
    ],
)
def test_one_value_for_all_samples(target, text, origin):
    assert origins_of({target: text}, ["Sense"], Source())[target] == origin


@pytest.mark.parametrize(
    ("target", "text", "error", "named"),
    [
        ("force_x", "0.5", ParameterError, ["'0.5'", "'force_x'"]),
        ("sweep", "-Fx", ParameterError, ["'-Fx'", "'sweep'", "sign"]),
        ("sweep", "2*Fx", ParameterError, ["'2*Fx'", "'sweep'", "factor"]),
        ("direction", "Fx[mm]", ParameterError, ["'Fx[mm]'", "'direction'", "unit"]),
        ("force_x", "0*Fx", ParameterError, ["factor above zero"]),
        ("force_x", "1e999*Fx", ParameterError, ["factor above zero"]),
        ("force_x", "Fx[kilopond]", ParameterError, ["'kilopond'", "N, kN, mN, µN or gf"]),
        ("force_x", "FX", RecordError, ["mean 'Fx'"]),
        ("force_x", "FX / mN", RecordError, ["mean 'Fx / mN'"]),
    ],
)
def test_what_cannot_stand_for_a_column(target, text, error, named):
    with refused(error, *named):
        origins_of({target: text}, ["Fx / mN"] if "/" in text else ["Fx"], Source())


RIG = {
    "Zeit [s]": np.arange(6.0),
    "Hub": [0, 0, 0, 1, 1, 1],
    "Richtung": ["forward"] * 3 + ["backward"] * 3,
    "Winkel [°]": 90 - np.degrees(columns()["drive_angle"]),
    "Moment": -1e3 * np.array(columns()["holding_moment"]),
    "Fx (mN)": 1e3 * np.array(columns()["force_x"]),
    "Fy": 1e3 * np.array(columns()["force_y"]) - 12.5,
}
NAMED = {
    "sweep": "Hub",
    "direction": "Richtung",
    "drive_angle": "90-Winkel",
    "holding_moment": "-Moment[N mm]",
    "force_x": "Fx (mN)",
    "force_y": "Fy[mN]+12.5",
    "base_y": "250[mm]",
}


def rig_file(path, table=RIG, *, delimiter=",", decimal=".", header=()):
    """A table as a file of a rig."""
    if path.suffix == ".nc":
        xr.Dataset({name: ("sample", values) for name, values in table.items()}).to_netcdf(path, engine="h5netcdf")
        return path
    rows = [
        delimiter.join(cell if isinstance(cell, str) else repr(cell).replace(".", decimal) for cell in row)
        for row in zip(*(np.asarray(values).tolist() for values in table.values()), strict=True)
    ]
    path.write_text("\n".join([*header, delimiter.join(table), *rows]) + "\n", encoding="utf-8")
    return path


def assert_same_measurement(record, other):
    for name in columns():
        if name in ("sweep", "direction"):
            assert record[name].values.tolist() == other[name].values.tolist()
        else:
            np.testing.assert_allclose(record[name].values, other[name].values, rtol=1e-14, atol=1e-16)
            assert record[name].attrs["units"] == other[name].attrs["units"]


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("rig.csv", {}),
        ("rig.csv", {"delimiter": ";", "decimal": ",", "header": ["\ufeffsep=;"]}),
        ("rig.csv", {"delimiter": ";"}),
        ("rig.csv", {"delimiter": "\t", "decimal": ","}),
        ("rig.nc", {}),
    ],
)
def test_a_rig_is_read_by_its_own_names_units_signs_and_zeros(tmp_path, name, options):
    record = read_record(rig_file(tmp_path / name, **options), Rig(rod=WIRE, file=NAMED))
    assert_same_measurement(record, make_record(columns(), Rig(rod=WIRE)))
    assert [name for name in record if name not in columns()] == ["Zeit [s]"]  # what stands for a column is not kept
    assert record["Zeit [s]"].values.tolist() == list(range(6))
    write_record(record, tmp_path / "again.csv")
    assert read_record(tmp_path / "again.csv").identical(record)


def test_units_in_names_are_read_without_being_told(tmp_path):
    names = "sweep,direction,drive_angle [deg],holding_moment [Nmm],force_x (mN),force_y/kN,base_x [cm]"
    (tmp_path / "rig.csv").write_text(f"{names}\n0,forward,60,2,-3,4,5\n")
    record = read_record(tmp_path / "rig.csv", Rig(rod=WIRE))
    read = [record[name].item() for name in ("drive_angle", "holding_moment", "force_x", "force_y", "base_x")]
    assert read == [np.radians(60.0), 2e-3, -3e-3, 4e3, 0.05]
    assert len(record) == 8


@pytest.mark.parametrize(
    ("lines", "fx", "named"),
    [
        (["A,Mz,Fx [kg],Fy", "deg,N mm,mN,mN"], "Fx", ["kg", "mN"]),
        (["A,Mz,Fx,Fy", "deg,N mm,mN,mN"], "Fx[N]", ["[mN]", "[N]"]),
        (["A,Mz,Fx [kg],Fy", "deg,N mm,,mN"], "Fx[mN]", ["kg", "mN"]),
        (["A,Mz,Fx_mN,Fy", "deg,N mm,,mN"], "Fx_mN[N]", ["mN", "[N]"]),
        (["# column Fx: number [N]", "A,Mz,Fx [mN],Fy", "deg,N mm,,mN"], "Fx", ["[N]", "[mN]"]),
        (["# column Fx: number [mN]", "A,Mz,Fx [mN],Fy", "deg,N mm,,mN"], "Fx", None),
        (["# column Fx: number [mN]", "A,Mz,Fx,Fy", "deg,N mm,,mN"], "Fx", None),
    ],
)
def test_units_in_two_places_agree_or_are_refused(tmp_path, lines, fx, named):
    path = tmp_path / "rig.csv"
    path.write_text("\n".join([*lines, "60,1,2,3", "61,1,2,3", ""]), encoding="utf-8")
    given = {"drive_angle": "A", "holding_moment": "Mz", "force_x": fx, "force_y": "Fy", "split_sweeps": True}
    if named is None:
        assert read_record(path, Rig(rod=WIRE, file=given)).force_x[0] == 2e-3
    else:
        with refused(RecordError, *named):
            read_record(path, Rig(rod=WIRE, file=given))


def test_a_header_is_read_and_its_units_are_converted_for_columns_and_attributes(tmp_path):
    path = tmp_path / "rig.csv"
    path.write_text(
        "# tactile_bayes record, format 1\n# rod_length: 200 [mm],,,,\n# rod_flexural_rigidity: 2400 [N mm²]\n"
        "# rod_diameter: 700 [µm]\n# anything else that people write\n# load_cell_force_noise: 3 [mN]\n"
        "# operator: somebody [trained]\n# column force_x: number [mN] Kraft\n# column truth_force_x: number [mN]\n"
        "# column drive_angle: number [mrad]\n# column temperature: number [K]\n\n"
        "sweep,direction,drive_angle,holding_moment,force_x,force_y,truth_force_x, temperature,count,ratio,note\n"
        "0,forward,1250,0.5,125,0.25,130,293,1,1.0,a\n\n0,forward,1250,0.5,125,0.25,130,,2,2.0,3\n",
        encoding="utf-8",
    )
    with pytest.warns(RecordWarning, match="holding_moment and force_y: .* N m and N"):
        record = read_record(path)
    assert (record.attrs["units"], rod_of(record)) == ("SI", Rod(0.2, 2.4e-3, 0.7e-3))
    assert (record.attrs["load_cell_force_noise"], record.attrs["operator"]) == (3e-3, "somebody [trained]")
    assert [record[name][0].item() for name in ("drive_angle", "force_x", "truth_force_x")] == [1.25, 0.125, 0.13]
    assert record["force_x"].attrs == {"units": "N", "long_name": "Kraft"}
    np.testing.assert_array_equal(record["temperature"], [293, np.nan])
    assert record["temperature"].attrs["units"] == "K"
    assert [record[name].dtype.kind for name in ("count", "ratio", "note")] == ["i", "f", "U"]
    assert "units_source" not in record.attrs


def test_units_of_netcdf_variables_are_converted(tmp_path):
    table = make_record(columns(), Rig(rod=WIRE))
    scaled = table.copy(deep=True)
    scaled["force_x"].values *= 1e3
    scaled["force_x"].attrs["units"] = "mN"
    scaled["drive_angle"].values = np.degrees(scaled["drive_angle"].values)
    scaled["drive_angle"].attrs["units"] = "degree"
    scaled.to_netcdf(tmp_path / "rig.nc", engine="h5netcdf")
    assert_same_measurement(read_record(tmp_path / "rig.nc"), table)


def test_dimensionless_records_take_degrees_and_no_other_unit(tmp_path):
    path = rig_file(tmp_path / "rig.csv", {**columns(), "drive_angle": np.degrees(columns()["drive_angle"])})
    record = read_record(path, Rig(file={"drive_angle": "drive_angle[deg]"}))
    assert (record.attrs["units"], record.attrs["units_source"]) == ("dimensionless", "assumed")
    np.testing.assert_allclose(record["drive_angle"], columns()["drive_angle"], rtol=1e-15)
    with refused(RecordError, path, "line 1, column 'force_x'", "[mN]", "dimensionless", "[1]"):
        read_record(path, Rig(rod=Rod(), file={"drive_angle": "drive_angle[deg]", "force_x": "force_x[mN]"}))
    with refused(RecordError, "rod_length and rod_flexural_rigidity", "not stated"):  # a unit of force is of SI
        read_record(path, Rig(file={"drive_angle": "drive_angle[deg]", "force_x": "force_x[N]"}))


def test_axes_may_be_exchanged(tmp_path):
    path = rig_file(tmp_path / "rig.csv", columns())
    turned = read_record(path, Rig(file={"force_x": "-force_y", "force_y": "force_x"}))
    np.testing.assert_array_equal(turned["force_x"], -np.array(columns()["force_y"]))
    np.testing.assert_array_equal(turned["force_y"], columns()["force_x"])


SLASHES = {"a / b": np.arange(6.0), "a [b]": np.arange(6.0)}


@pytest.mark.parametrize(
    ("changes", "given", "named"),
    [
        ({}, {"force_x": "Fz[mN]"}, ["column 'Fz'", "'force_x'", "(columns: Zeit [s], Hub,"]),
        ({}, {"force_y": "90-Fyy[mN]"}, ["column 'Fyy'", "'force_y'"]),
        ({}, {"base_y": "height"}, ["like 12[mm]"]),
        ({}, {"direction": "up"}, ["like forward"]),
        ({"force_y": np.zeros(6)}, {}, ["line 1, column 'force_y'", "'Fy[mN]+12.5'"]),
        ({}, {"force_y": "Fy[mm]"}, ["line 1, column 'force_y'", "'Fy'", "[mm]", "N, kN, mN, µN or gf"]),
        ({}, {"base_y": "12[deg]"}, ["'base_y'", "[deg]", "m, cm, mm or µm"]),
        ({}, {"force_x": "Fx (mN)[N]"}, ["'Fx (mN)'", "[mN]", "[N]"]),
        ({"Fy": ["1", "2", "x", "4", "5", "6"]}, {}, ["line 4, column 'Fy'", "'x'"]),
        ({"Fy": ["1", "2", "", "4", "5", "6"]}, {}, ["line 4, column 'force_y'", "'Fy'", "nan"]),
        ({"Fz [ch1]": np.zeros(6)}, {"force_y": "Fz [ch1]"}, ["line 1, column 'force_y'", "'Fz [ch1]'", "in [ch1]"]),
        # What is wrong with a measured column comes before a name that cannot be stored.
        (SLASHES, {}, ["the name 'a / b'", "cannot be stored", "as 'a [b]'"]),
        (SLASHES, {"force_x": "Fz"}, ["column 'Fz'", "'force_x'"]),
        (SLASHES | {"Fy": ["1", "2", "", "4", "5", "6"]}, {}, ["line 4, column 'force_y'", "'Fy'", "missing"]),
        (
            SLASHES | {"Moment": None},
            {"holding_moment": None},
            [", Fy, a / b, a [b])", 'holding_moment = "NAME[UNIT]"'],
        ),
        ({"Winkel [°]": None, "drive/angle": np.ones(6)}, {"drive_angle": None}, ["{'drive_angle': 'drive/angle'}"]),
    ],
)
def test_what_does_not_fit_the_file_is_refused_with_its_place(tmp_path, changes, given, named):
    path = rig_file(tmp_path / "rig.csv", {name: of for name, of in {**RIG, **changes}.items() if of is not None})
    file = {target: text for target, text in {**NAMED, **given}.items() if text is not None}
    with refused(RecordError, *named) as caught:
        read_record(path, Rig(rod=WIRE, file=file))
    assert str(caught.value).startswith(f"{path}: ")


@pytest.mark.parametrize(
    ("name", "kept"),
    [("Temp / °C", "Temp [°C]"), ("Dauer / s", "Dauer [s]"), ("Fx/Fy", "Fx|Fy"), ("v / m/s", "v [m|s]")],
)
def test_a_further_column_with_a_slash_is_kept_under_a_name_that_every_file_can_store(tmp_path, name, kept):
    path = rig_file(tmp_path / "rig.csv", {**RIG, name: np.arange(6.0)})
    record = read_record(path, Rig(rod=WIRE, file=NAMED))
    assert record[kept].values.tolist() == list(range(6))
    assert record[kept].attrs == {"units": "unknown", "long_name": name}
    for suffix in ("csv", "nc"):
        write_record(record, tmp_path / f"again.{suffix}")
        assert read_record(tmp_path / f"again.{suffix}").identical(record)
    rig_file(path, {**RIG, name: np.arange(6.0)}, header=[f'# column "{name}": number [°C] air'])
    assert read_record(path, Rig(rod=WIRE, file=NAMED))[kept].attrs == {"units": "°C", "long_name": "air"}


@pytest.mark.parametrize(
    ("given", "correction", "offset", "sign"),
    [
        ("A", "A[deg]", 0, 1),
        ("-A", "-A[deg]", 0, -1),
        ("-A+90", "90-A[deg]", 90, -1),
        ("A-0.5", "-0.5+A[deg]", -0.5, 1),
    ],
)
def test_what_looks_like_degrees_is_refused_with_an_entry_that_reads_it(tmp_path, given, correction, offset, sign):
    table = {**columns(sweep=None, direction=None, drive_angle=None), "A": np.degrees(columns()["drive_angle"])}
    path = rig_file(tmp_path / "rig.csv", table)
    with refused(RecordError, f"Rig(file={{'drive_angle': '{correction}'}}), or drive_angle = \"{correction}\""):
        read_record(path, Rig(file={"drive_angle": given, "split_sweeps": True}))
    record = read_record(path, Rig(file={"drive_angle": correction, "split_sweeps": True}))
    np.testing.assert_allclose(record["drive_angle"], np.radians(offset + sign * table["A"]), rtol=1e-12)


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("added", [0.0, 0.0182, -0.5])
@pytest.mark.parametrize("given", ["Fx[mN]", "-Fx[mN]", "12.5-Fx[mN]", "Fx[mN]-0.125", "12.5-0.1*Fx[mN]", "3*Fx[mN]"])
def test_an_entry_reads_a_column_with_another_sign_and_zero(tmp_path, given, added, sense):
    path = tmp_path / "lab.csv"
    path.write_text("sweep,direction,drive_angle [rad],Fx\n0,forward,1.2,18.25\n0,forward,1.3,-7.5\n")

    def read(text):
        channels = ("holding_moment", "force_y")
        return read_record(path, Rig(rod=Rod(0.1, 1.2e-5), file={"force_x": text, "missing": channels}))["force_x"]

    first = read(given)
    text = column_entry(first, sense=sense, added=added)
    np.testing.assert_allclose(read(text), sense * first + added, rtol=1e-12, atol=1e-15)


def test_where_there_is_no_file_an_entry_has_the_name_of_the_record(tmp_path):
    """And there is none after a conversion by the rod."""
    assert column_entry(xr.DataArray([0.0], name="force_x", attrs={"units": "1"}), sense=-1) == "-force_x"
    record = read_record(rig_file(tmp_path / "rig.csv"), Rig(rod=WIRE, file=NAMED))
    assert column_entry(to_dimensionless(record)["force_x"], added=1.0) == ""


def test_a_column_is_scaled_by_its_factor(tmp_path):
    """Readings of an amplifier: counts in a unit that no file states, and a column that is used twice."""
    path = tmp_path / "counts.csv"
    path.write_text("sweep,direction,phi,counts\n0,forward,130,2000\n0,forward,120,-500\n")
    given = {"drive_angle": "90-0.1*phi[deg]", "force_x": "1e-3*counts[N]", "force_y": "-0.5*counts[mN]"}
    record = read_record(path, Rig(rod=WIRE, file={**given, "missing": ["holding_moment"]}))
    np.testing.assert_allclose(np.degrees(record.drive_angle), [77.0, 78.0], rtol=1e-12)
    np.testing.assert_allclose(record.force_x, [2.0, -0.5], rtol=1e-12)
    np.testing.assert_allclose(record.force_y, [-1.0, 0.25], rtol=1e-12)
