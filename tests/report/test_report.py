"""The report of a run: what it says, that its numbers are the posterior's, and that no text of a record escapes."""

import base64
import contextlib
import dataclasses
import hashlib
import io
import json
import re
import shlex
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from scipy import stats

import tactile_bayes as tb
from helpers.contour_posteriors import only
from helpers.refusals import refused
from helpers.report_pages import (
    COLUMN,
    ENTRY,
    FILE,
    FOLDER,
    LONG_NAME,
    UNIT,
    VALUE,
    Page,
    analysed_quickly,
    coarse_record,
    comparison,
    hostile_run,
)
from tactile_bayes.diagnostics.findings import Finding
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.contour import contours_of
from tactile_bayes.inference.parameters.unknowns import unknowns_of
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood
from tactile_bayes.inference.result import posterior_draws, read_result, record_of, write_result
from tactile_bayes.record import CHANNELS, record_hash, rod_of
from tactile_bayes.report.background import hindrances
from tactile_bayes.report.contour_figure import contour_figure
from tactile_bayes.report.drawing import Plot, Scale
from tactile_bayes.report.findings import findings_of
from tactile_bayes.report.page import page_of
from tactile_bayes.report.readings_figure import motion_of, readings_figure
from tactile_bayes.report.trust import contacts_messages
from tactile_bayes.runs.readings import reconstruction_messages
from tactile_bayes.uncertainty.summary import gap_if_any, summary

COMMAND = ["tactile-bayes", "infer", "measured.csv", "--rig", "rig.toml", "--out", "my run"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    path = folder / "measured.csv"
    tb.write_record(coarse_record(), path)
    analysed_quickly(
        tb.read_record(path), folder, rig=tb.Rig(unknown="nothing"), probability=0.9, record_file=path, command=COMMAND
    )
    return folder


@pytest.fixture(scope="module")
def text(folder):
    return tb.write_report(folder).read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def page(text):
    return Page(text)


@pytest.fixture(scope="module")
def posterior(folder):
    return read_result(folder / "posterior.nc")


@pytest.fixture(scope="module")
def findings(folder):
    return findings_of(folder)


@pytest.fixture(scope="module")
def hostile(tmp_path_factory):
    return hostile_run(tmp_path_factory.mktemp("hostile"))


# --- Structure ----------------------------------------------------------------------------------------------------


def test_the_page_is_well_formed_and_its_headings_are_in_order(page, text):
    assert text.startswith("<!DOCTYPE html>")
    assert page.open == []
    assert page.all("html")[0]["lang"] == "en-GB"
    levels = [int(tag[1]) for tag, _ in page.elements if re.fullmatch(r"h[1-6]", tag)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))
    assert page.texts["h2"] == ["Results", "Can the results be trusted?", "Readings", "Details", "Reproducing the run"]


def test_every_reference_within_the_page_has_its_target(page):
    ids = [attrs["id"] for _, attrs in page.elements if "id" in attrs]
    assert len(ids) == len(set(ids))
    wanted = [attrs["href"].removeprefix("#") for attrs in page.all("a")]
    for _, attrs in page.elements:
        for name in ("for", "aria-labelledby", "aria-describedby"):
            wanted += (attrs.get(name) or "").split()
        for value in attrs.values():
            wanted += re.findall(r"url\(#([^)]+)\)", value or "")
    assert set(wanted) <= set(ids)
    assert len(wanted) > 20


def test_every_drawing_has_words_and_every_control_a_label(page):
    drawings = page.all("svg")
    readings = [f"readings-{name}" for name in ("holding-moment", "force-x", "force-y")]
    assert [attrs["id"] for attrs in drawings] == ["contour-map", "band-detail", "rod-map", *readings]
    assert all(attrs["role"] == "img" for attrs in drawings)
    assert all(words.strip() for words in page.texts["title"] + page.texts["desc"])
    assert len(page.texts["desc"]) == len(drawings)
    labelled = {attrs["for"] for attrs in page.all("label")}
    assert {attrs["id"] for tag in ("input", "select") for attrs in page.all(tag)} == labelled


def test_the_page_loads_nothing_and_runs_nothing_but_its_own_script(page, text):
    policy = next(attrs["content"] for attrs in page.all("meta") if attrs.get("http-equiv"))
    script = next(
        words for attrs, words in zip(page.all("script"), page.texts["script"], strict=True) if "type" not in attrs
    )
    digests = [
        base64.b64encode(hashlib.sha256(words.encode()).digest()).decode() for words in (script, page.texts["style"][0])
    ]
    assert policy == (
        f"default-src 'none'; script-src 'sha256-{digests[0]}'; style-src 'sha256-{digests[1]}'; base-uri 'none'; "
        "form-action 'none'"
    )
    assert len(text.encode()) < 500_000
    assert not re.search(r"https?://|@import|eval\(|url\((?!#)", text)
    assert len(page.all("script")) == 2
    assert {tag for tag, _ in page.elements} & {"img", "link", "iframe", "object", "embed", "base", "form"} == set()
    for _, attrs in page.elements:
        assert not any(name.startswith("on") or name in ("style", "src", "srcset", "action") for name in attrs)
        assert (attrs.get("href") or "#").startswith("#")


# --- Numbers ------------------------------------------------------------------------------------------------------


def number(cell):
    return float(cell.replace("−", "-"))


def test_the_parameters_are_those_of_the_posterior(page, posterior):
    rows = {row[0]: row for row in page.table("Estimates are medians")[1:]}
    numbers = summary(posterior, 0.9, gap_if_any(posterior, 0.9))
    assert list(rows) == numbers["quantity"].values.tolist()
    for name, row in rows.items():
        of_name = numbers.sel(quantity=name)
        for cell, column in zip(row[3:6], ("median", "lower", "upper"), strict=True):
            rounding = 0.5001 * 10.0 ** -len(cell.partition(".")[2])
            assert number(cell) == pytest.approx(float(of_name[column]), abs=rounding)
        assert row[2] == ("" if of_name["unit"] == "1" else of_name["unit"].item())
    assert page.table("Estimates are medians")[0][4] == "90\u00a0% from"


def test_the_band_in_words_and_table_is_that_of_the_posterior(page, posterior):
    rows = 1e-3 * np.array(
        [[number(cell) for cell in row] for row in page.table("The band at some positions [mm]")[1:]]
    )
    band = tb.contour_band(posterior, rows[:, 0], 0.9)
    steep = np.max(np.abs(np.gradient(band["median"].values, rows[:, 0]))) * 0.05e-3  # x is rounded, too
    for column, name in enumerate(("lower", "median", "upper"), start=1):
        np.testing.assert_allclose(rows[:, column], band[name], atol=steep + 0.5e-6)
    said = page.data["band"]["said"]
    assert len(said) == 201
    assert re.fullmatch(r"x = \S+\u00a0mm: y .*\S+ to \S+\u00a0mm .*90\u00a0%, median \S+\u00a0mm", said[0])


def test_what_is_worked_out_again_is_what_the_run_has_written(folder, findings):
    contacts = pd.read_csv(folder / "contacts.csv", index_col="sample")
    np.testing.assert_allclose(findings.contacts["contact_y"], contacts["contact_y"], rtol=1e-13)
    band = pd.read_csv(folder / "band.csv", index_col="x")
    np.testing.assert_allclose(findings.band["upper"], band["upper"], rtol=1e-13)
    lines = (folder / "summary.txt").read_text(encoding="utf-8").splitlines()
    assert findings.checked.messages == tuple(lines[: lines.index("")])
    assert findings.probability == 0.9


def test_the_gap_is_told_as_far_as_convexity_confines_it_with_uncertain_ends(page, findings):
    edges = findings.edges
    said = next(words for words in page.texts["p"] if "convexity alone" in words)
    shown = re.findall(r"up to (\S+)\u00a0(µm|mm) wide", said)
    certificate, band = (float(value) * {"µm": 1e-6, "mm": 1e-3}[unit] for value, unit in shown)
    assert certificate == pytest.approx(float((edges["triangle_upper"] - edges["triangle_lower"]).max()), rel=0.05)
    assert band == pytest.approx(float(edges["band_width"]), rel=0.05)
    assert band < certificate


@pytest.mark.parametrize("score", [-7.0, -5.9, -4.0, 4.0, 5.9, 7.0])
def test_the_force_along_the_rod_is_judged_as_by_reconstruct(findings, score):
    contacts = findings.contacts.assign_attrs(axial_score=score)
    said = contacts_messages(dataclasses.replace(findings, contacts=contacts))[-1]
    elsewhere = " ".join(reconstruction_messages(contacts))
    for words in ("agrees with the moment", "too small", "too large", "as with friction", "check the zero"):
        assert (words in said) == (words in elsewhere)
    assert "was stated" in said
    tree = findings.posterior.copy()
    tree.attrs["nuisances"] = '["friction"]'
    found = dataclasses.replace(findings, contacts=contacts, posterior=tree)
    assert "was inferred" in contacts_messages(found)[-1]


def test_the_verdicts_come_first_and_say_whether_to_trust(page, folder, text):
    first = (folder / "summary.txt").read_text(encoding="utf-8").splitlines()[0]
    assert first.startswith("NOT CONVERGED")
    assert f"Read this first. {first}" in page.texts["p"]
    assert next(attrs["class"] for attrs in page.all("p") if "verdict" in (attrs.get("class") or "")) == "verdict ill"
    assert text.index(first.split(",")[0]) < text.index("<svg")


def test_a_contour_is_known_to_within_its_band_only_where_all_is_well(findings):
    """Of one that the record rejects nothing is said but with an if."""

    def told(messages, well, **passed):
        predictive = findings.checked.predictive.assign_attrs(**passed)
        checked = tb.diagnostics.Check(messages, well, predictive)
        return page_of(dataclasses.replace(findings, checked=checked), "run")

    well = told((Finding("all is well", drawn="ensembles agree", p_value="0.5"),), True, passed=True)
    doubtful = told(findings.checked.messages, False, passed=True)
    rejected = told((Finding("contradiction", chance="0", dragging=""),), False, passed=False)
    assert "known to within a 90\u00a0% band" in well["answer"]
    for page in (doubtful, rejected):
        assert "known to within" not in page["answer"]
        assert re.findall(r"\d[\d.]*", page["answer"]) == re.findall(r"\d[\d.]*", well["answer"])
    (gap, certificate), (only,) = well["gap"], rejected["gap"]
    assert "convexity alone" in certificate
    assert ("would be" in gap, "would be" in only) == (False, True)
    assert re.findall(r"[\d.]+", only) == re.findall(r"[\d.]+", gap)
    assert len({page["contacts"][1] for page in (well, rejected)}) == 2


def test_where_it_came_from_is_said(page, folder, posterior):
    digests = dict(page.table("SHA-256")[1:])
    assert digests == {
        "posterior.nc": hashlib.sha256((folder / "posterior.nc").read_bytes()).hexdigest(),
        "record, as stored in it": record_hash(tb.read_record(folder / "measured.csv")),
        "file measured.csv": hashlib.sha256((folder / "measured.csv").read_bytes()).hexdigest(),
    }
    assert posterior.attrs["data_sha256"] == digests["record, as stored in it"]
    versions = dict(page.table("Software")[1:])
    assert versions["numpy"] == np.__version__
    assert versions["tactile-bayes"] == tb.__version__
    assert "Python" in versions
    assert shlex.split(page.texts["code"][0]) == COMMAND
    assert "The contour from measured.csv" in page.texts["h1"][0]


def test_the_lines_that_it_gives_make_the_same_draws(page, folder, monkeypatch):
    monkeypatch.chdir(folder)
    assert "tactile_bayes." not in page.texts["code"][1]  # its public face is enough
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        exec(compile(page.texts["code"][1], "lines", "exec"), {})
    assert said.getvalue() == "True\n"


def test_what_hinders_that_is_said(posterior):
    assert hindrances(posterior.attrs) == []
    settings = json.dumps({"max_seconds": 5.0})
    clock, priors = hindrances(posterior.attrs | {"rig": "not written", "settings": settings})
    assert "by the clock" in clock
    assert "give rig=" in priors


# --- The moving rod -----------------------------------------------------------------------------------------------


def test_the_rod_moves_as_a_scan_of_the_most_probable_contour_has_it(posterior):
    motion = motion_of(posterior)
    record, rod = record_of(posterior), rod_of(record_of(posterior))
    for number_, direction in ((0, "forward"), (1, "backward")):
        angles = record["drive_angle"].values[record["sweep"].values == number_]
        ideal = tb.scan(motion.contour, direction=direction, drive_angles=angles, rig=tb.Rig(rod=rod)).record
        of_sweep = motion.sweep == number_
        np.testing.assert_array_equal(motion.phase[of_sweep], ideal["truth_contact_phase"])
        for k, name in enumerate(CHANNELS):
            np.testing.assert_allclose(
                motion.loads[of_sweep, k], ideal[name], atol=1e-6 * float(abs(ideal[name]).max())
            )
        np.testing.assert_allclose(motion.contact_x[of_sweep], ideal["truth_contact_x"], atol=1e-8)
    gaps = np.hypot(motion.rod_x - motion.contact_x[:, None], motion.rod_y - motion.contact_y[:, None]).min(axis=1)
    touching = motion.phase != "none"
    assert np.all(gaps[touching] < 0.5 * rod.diameter + rod.length / 60)
    lengths = np.hypot(np.diff(motion.rod_x, axis=1), np.diff(motion.rod_y, axis=1)).sum(axis=1)
    np.testing.assert_allclose(lengths, rod.length, rtol=2e-3)


def test_the_rig_of_the_most_probable_draw_moves_it(posterior):
    """Against the loads by which the likelihood judges that draw, which are interpolated."""
    rig = {
        "rigidity_scale": 1.05,
        "drive_angle_offset": 0.01,
        "backlash": 0.006,
        "suspension_compliance": 0.4,
        "friction": 0.2,
        "base_2_x": 0.002,
        "moment_bias": 1e-4,
        "length": 1.01 * rod_of(record_of(posterior)).length,
    }
    tree = with_rig(posterior, rig)
    motion, record = motion_of(tree), record_of(tree)
    expected = predicted(tree, rig)[motion.samples]
    largest = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(motion.loads / largest, expected / largest, atol=1e-5)
    misread = np.where(record["direction"].values == "forward", 0.013, 0.007)
    driven = (record["drive_angle"].values - misread)[motion.samples]
    turned = motion.drive_angle + rig["suspension_compliance"] * motion.loads[:, 0]
    np.testing.assert_allclose(turned, driven, atol=1e-9)
    np.testing.assert_allclose(motion.cell_angle, driven, atol=1e-9)
    np.testing.assert_allclose(motion.rod_x[:, 0], np.where(motion.sweep == 1, 0.052, 0.0))
    np.testing.assert_allclose(motion.pivots, [[0.0, 0.0], [0.052, 0.0]])
    lengths = np.hypot(np.diff(motion.rod_x, axis=1), np.diff(motion.rod_y, axis=1)).sum(axis=1)
    np.testing.assert_allclose(lengths, rig["length"], rtol=2e-3)
    touching = motion.phase == "tip"
    off = [motion.rod_x[:, -1] - motion.contact_x, motion.rod_y[:, -1] - motion.contact_y]
    assert np.all(np.hypot(*off)[touching] < 0.51 * rod_of(record).diameter)


def test_loads_are_shown_along_the_axes_of_a_cell_that_turns_with_the_drive(findings):
    """The suspension gives way beyond the cell, so that the cell is not turned with the rod."""
    rig = {"suspension_compliance": 3.0, "drive_angle_offset": 0.01}
    tree = with_rig(findings.posterior, rig, load_cell_frame="turning")
    turning, motion = dataclasses.replace(findings, posterior=tree, record=record_of(tree)), motion_of(tree)
    expected = predicted(tree, rig)[motion.samples]
    figure = readings_figure(turning, motion)
    for k, name in enumerate(CHANNELS):
        shown = [number(rows[2]) for rows in figure.data["said"][name]]
        wanted = expected[:, k] * 10.0 ** -figure.shown[name].power
        rounding, interpolation = 5e-4, 1e-5 * np.abs(wanted).max()
        np.testing.assert_allclose(shown, wanted, rtol=rounding, atol=interpolation)
    assert np.abs(motion.cell_angle - motion.drive_angle).max() > 0.05


def test_pivots_are_marked_where_they_were_found(findings):
    tree = with_rig(findings.posterior, {"base_2_x": 0.02})
    shifted, motion = dataclasses.replace(findings, posterior=tree, record=record_of(tree)), motion_of(tree)
    moving, overview = readings_figure(shifted, motion), contour_figure(shifted)
    ends_of_rods = np.array(moving.data["rod"])[:, :2]
    assert marked(moving.rods) == sorted(set(map(tuple, ends_of_rods.tolist())))
    per_metre = np.ptp(overview.band["mapX"]) / np.ptp(findings.band["x"].values)
    apart = np.diff(marked(overview.map), axis=0)
    np.testing.assert_allclose(apart, [[0.07 * per_metre, 0.0]], atol=0.5)  # of the drawing's tenths


def marked(drawing):
    """Places of pivots in a drawing, from left to right."""
    found = [attrs for attrs in Page(drawing).all("circle") if attrs["class"] == "pivot"]
    return sorted((float(attrs["cx"]), float(attrs["cy"])) for attrs in found)


def with_rig(posterior, rig, **attrs):
    """The posterior as if every draw had this rig; its second sweep has a pivot of its own."""
    draws = posterior_draws(posterior)
    draws = draws.assign({name: xr.full_like(draws["q"], value) for name, value in rig.items()})
    columns = posterior["constant_data"].to_dataset()
    columns["base_x"] = columns["base_x"].copy(data=np.where(columns["sweep"] == 1, 0.05, 0.0))
    groups = {name: group.to_dataset() for name, group in posterior.children.items()}
    tree = xr.DataTree.from_dict({**groups, "posterior": draws, "constant_data": columns})
    tree.attrs = posterior.attrs | {"nuisances": json.dumps(list(rig))} | attrs
    return tree


def predicted(tree, rig):
    """Loads of the most probable draw by which the likelihood judges the record, shape (samples, 3)."""
    record = record_of(tree)
    best = posterior_draws(tree).isel(tree["sample_stats"]["lp"].argmax(("chain", "draw")))
    cell, rod = tb.LoadCell.from_record(record), rod_of(record)
    unknowns = unknowns_of(record, tb.Rig(unknown=only(*rig)), cell)
    values = {name: np.array([value]) for name, value in rig.items()}
    likelihood = RecordLikelihood(record, cell, exact=True)
    loads, _ = likelihood.predict(contours_of(best, "parabola"), unknowns.rig(values))
    return loads[0] * rod.load_units


def test_of_a_long_record_some_samples_are_shown_of_every_sweep(posterior):
    every, few = motion_of(posterior), motion_of(posterior, most=20)
    assert few.every == -(-every.samples.size // 20)
    assert set(few.sweep) == {0, 1}
    assert set(few.samples) < set(every.samples)


def test_the_frames_are_those_rods_in_the_drawing(page, posterior):
    frames, motion = page.data["frames"], motion_of(posterior)
    assert len(frames["rod"]) == motion.samples.size
    drawn = np.array(frames["rod"]).reshape(motion.samples.size, -1, 2)
    for axis, values in ((0, motion.rod_x), (1, motion.rod_y)):
        slope, offset = np.polyfit(values.ravel(), drawn[..., axis].ravel(), 1)
        np.testing.assert_allclose(drawn[..., axis], slope * values + offset, atol=0.06)
        assert (slope > 0) == (axis == 0)
    assert [point is None for point in frames["contact"]] == (motion.phase == "none").tolist()
    readings = [number(rows[0]) for rows in frames["said"]["holding_moment"]]
    measured = record_of(posterior)["holding_moment"].values[motion.samples]
    np.testing.assert_allclose(readings, 1e3 * measured, rtol=6e-4)


# --- Other records ------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_rig_that_measures_the_moment_only_has_no_contact_points(tmp_path):
    ideal = tb.scan(tb.contours.Parabola(0.5, 0.5), direction="backward", drive_step=0.1).record
    record = tb.LoadCell(force_noise=0.05, moment_noise=0.02).measure(ideal, rng=1)
    record["force_x"][:] = record["force_y"][:] = np.nan
    analysed_quickly(record, tmp_path, rig=tb.Rig(unknown="nothing"))
    page = Page(tb.write_report(tmp_path).read_text(encoding="utf-8"))
    assert any(re.match("Contact points .*force x and force y", words) for words in page.texts["p"])
    assert any("no gap between" in words for words in page.texts["p"])
    assert [attrs["id"] for attrs in page.all("svg")][-1] == "readings-holding-moment"
    assert page.data["frames"]["said"]["force_x"][0][:2] == ["not measured", "not measured"]
    assert any("in rod lengths L" in words for words in page.texts["p"])


@pytest.mark.slow
def test_a_shape_free_contour_hides_its_directions_among_the_details(tmp_path):
    few = tb.SamplerSettings(ensembles=2, walkers=80, block_steps=5, max_steps=5)
    analysed_quickly(coarse_record(), tmp_path, family="shape-free", rig=tb.Rig(unknown="nothing"), settings=few)
    page = Page(tb.write_report(tmp_path).read_text(encoding="utf-8"))
    names = [row[0] for row in page.table("Estimates are medians")]
    assert "length_scale" in names
    assert not any(name.startswith("z_") for name in names)
    assert "z_1" in [row[0] for row in page.table("All parameters")]


def test_probabilities_of_shapes_are_told_where_there_are_some(folder, posterior, tmp_path):
    comparison(posterior.attrs["data_sha256"]).to_netcdf(tmp_path / "comparison.nc", engine="h5netcdf")
    page = Page(tb.write_report(folder, tmp_path / "page.html", compare=tmp_path).read_text(encoding="utf-8"))
    assert "ellipse with probability 0.90" in page.texts["p"]
    assert page.table("Shapes")[1:] == [
        ["ellipse", "0.900", "10.0", "0.200", "yes"],
        ["parabola", "0.100", "8.0", "0.300", "yes"],
        ["circle", "–", "–", "–", "not sampled"],
    ]
    assert [float(attrs["value"]) for attrs in page.all("meter")] == [0.9, 0.1, 0.0]


# --- Escaping -----------------------------------------------------------------------------------------------------


def test_no_text_of_a_record_becomes_an_element(hostile):
    text = tb.write_report(hostile).read_text(encoding="utf-8")
    page = Page(text)
    assert page.open == []
    assert len(page.all("script")) == 2
    assert page.all("img") == page.all("b") == []
    assert "49" not in [cell for row in page.table("Attributes of the record") for cell in row]
    assert "onerror" not in {name for _, attrs in page.elements for name in attrs}
    assert page.table("Further columns")[1:] == [[COLUMN, UNIT, LONG_NAME]]
    assert [ENTRY, VALUE] in page.table("Attributes of the record")
    assert page.texts["h1"] == [f"The contour from {FILE}"]
    assert page.texts["title"][0] == f"Contour from {FILE} – tactile_bayes"
    assert any(words.endswith(f" {FOLDER}") for words in page.texts["p"])


def test_what_the_script_is_given_cannot_end_it():
    from tactile_bayes.report.writing import _as_json

    attack = {"a": "</script><!--<script>&\u2028\u2029"}
    said = _as_json(attack)
    assert not set("<>&\u2028\u2029") & set(said)
    assert json.loads(said) == attack


# --- Refusals -----------------------------------------------------------------------------------------------------


def not_reported(folder, *named, **options):
    with refused(InferenceError, *named) as caught:
        tb.write_report(folder, **options)
    assert len(str(caught.value).splitlines()) == 1


def test_what_is_no_run_is_refused(folder, tmp_path):
    not_reported(tmp_path / "nowhere", tmp_path / "nowhere", "tactile-bayes infer")
    not_reported(folder / "band.csv", "band.csv", "folder")
    not_reported(tmp_path, "posterior.nc")
    comparison().to_netcdf(tmp_path / "comparison.nc", engine="h5netcdf")
    not_reported(tmp_path, "posterior.nc", "comparison")
    draws = xr.Dataset({"q": (("chain", "draw"), np.zeros((2, 9)))})
    write_result(xr.DataTree.from_dict({"posterior": draws}), tmp_path / "posterior.nc")
    not_reported(tmp_path, "posterior", "sample_stats, posterior_predictive, events")
    assert not (tmp_path / "report.html").exists()


def test_a_comparison_that_is_none_or_of_another_record_is_refused(folder, tmp_path):
    not_reported(folder, "comparison.nc", "--compare", compare=tmp_path)
    path = tmp_path / "comparison.nc"
    path.write_bytes(b"nothing")
    not_reported(folder, "comparison.nc", "damaged", compare=tmp_path)
    xr.Dataset({"a": 1.0}).to_netcdf(path, engine="h5netcdf")
    not_reported(folder, "comparison.nc", "comparison of shapes", compare=tmp_path)
    comparison().to_netcdf(path, engine="h5netcdf")
    not_reported(folder, "another record", compare=tmp_path)
    unstated = comparison()
    del unstated.attrs["data_sha256"]
    unstated.to_netcdf(path, engine="h5netcdf")
    not_reported(folder, "comparison.nc", "which record", compare=tmp_path)
    (tmp_path / "posterior.nc").write_bytes((folder / "posterior.nc").read_bytes())
    assert findings_of(tmp_path).comparison is None  # where it was not asked for, it is left out


def test_a_posterior_that_states_little_is_reported_all_the_same(posterior, tmp_path):
    """As written by `tb.write_result`, and by versions that stated less."""
    bare = posterior.copy()
    for name in ("versions", "probability", "command", "record_file", "record_file_sha256", "record_attributes"):
        del bare.attrs[name]
    bare.attrs["priors"] = json.dumps({"q": str(stats.norm)})
    write_result(bare, tmp_path / "posterior.nc")
    page = Page(tb.write_report(tmp_path).read_text(encoding="utf-8"))
    assert dict(page.table("Software")[1:])["tactile-bayes"] == tb.__version__
    assert page.texts["h1"] == [f"The contour of the run {tmp_path.name}"]
    assert "95\u00a0% from" in page.table("Estimates are medians")[0]


# --- Parts --------------------------------------------------------------------------------------------------------


def areas(x, lower, upper):
    plot = Plot(Scale(0.0, 1.0, 0.0, 1.0), Scale(0.0, 1.0, 0.0, 1.0), "x", "y")
    plot.area(x, lower, upper, "band")
    return Page(plot.content[0]).all("path")[0]["d"]


def test_a_band_is_drawn_in_pieces_where_both_edges_are_known():
    nan = np.nan
    assert areas([0, 1, 2], [1, 1, 1], [2, 2, 2]) == "M0 1L1 1L2 1L2 2L1 2L0 2Z"
    assert areas([0, 1, 2, 3], [1, 1, 1, nan], [2, 2, 2, nan]) == "M0 1L1 1L2 1L2 2L1 2L0 2Z"
    assert areas([0, 1, 2, 3, 4], [1, 1, nan, 1, 1], [2, 2, 2, 2, 2]) == "M0 1L1 1L1 2L0 2ZM3 1L4 1L4 2L3 2Z"
    assert areas([0, 1, 2], [1, 1, 1], [nan, 2, 2]) == "M1 1L2 1L2 2L1 2Z"
    assert areas([0, 1], [nan, nan], [2, 2]) == areas([], [], []) == ""
