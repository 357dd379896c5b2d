"""The command watch: a record that grows, in a folder."""

import json
import os
import re
import signal
import threading
import time
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import tactile_bayes as tb
from helpers import commands
from helpers.report_pages import Page
from tactile_bayes.cli import watching
from tactile_bayes.contours import paper_profile
from tactile_bayes.load_cell import LoadCell, RandomWalk
from tactile_bayes.runs import watch
from tactile_bayes.runs.watch import open_watch

FEW = ("--particles", 120)

pytestmark = pytest.mark.usefixtures("undrawn")


@pytest.fixture(scope="module")
def lines(record):
    """Header and rows of the file of a record, with their ends."""
    whole = record.read_text(encoding="utf-8").splitlines(keepends=True)
    head = next(number for number, line in enumerate(whole) if not line.startswith("#")) + 1
    return whole[:head], whole[head:]


@pytest.fixture
def path(tmp_path):
    return tmp_path / "live.csv"


@pytest.fixture(scope="module")
def rows(lines):
    return lines[1]


@pytest.fixture
def measure(path, lines):
    """Write the file anew, with its header and these rows."""
    return lambda *parts: path.write_text(
        "".join(line for part in (lines[0], *parts) for line in part), encoding="utf-8"
    )


@pytest.fixture
def follow(path, as_stated, monkeypatch):
    """Call the command, with what happens to the file at each look at it; it ends when nothing happens any more."""

    def call(*options, then=(), json=False, rig=as_stated):
        actions = iter(then)

        def act(seconds):
            next(actions, lambda: None)()

        monkeypatch.setattr(watching.time, "sleep", act)
        words = [*FEW, *options, *(["--json"] if json else [])]
        return commands.call("watch", path, "--out", path.parent / "run", "--idle", 0, "--rig", rig, *words)

    return call


def objects(result):
    assert result.exit_code == 0, result.output
    return [json.loads(line) for line in result.stdout.splitlines()]


def streamed(*parts):
    """Medians of a stream that is given these parts of a record one after the other."""
    stream = tb.Stream(rig=tb.Rig(unknown="nothing"), rng=1, particles=120)
    for part in parts:
        stream.update(part)
    return [float(np.median(values)) for values in stream.posterior()["posterior"].data_vars.values()]


def test_it_follows_a_file_and_ends_with_the_answer_of_a_run(path, follow, rows, measure):
    measure(rows[:60])
    result = follow(then=[partial(measure, rows[:100], rows[100][:9]), partial(measure, rows[:130])])
    assert result.exit_code == 0, result.output
    said = result.stdout.splitlines()
    assert said[0].startswith("60 samples, 60 new; band up to ")
    assert said[0].endswith(" s behind")
    assert said[1].startswith("    a ")
    assert " 1/m, q " in said[1]
    assert said[2].startswith("100 samples, 40 new")
    assert said[4].startswith("130 samples, 30 new")
    assert said[6].startswith("Ended after 130 samples: ")
    assert said[8].startswith("All is well: the particles ")
    folder = path.parent / "run"
    assert {"stream.nc", "posterior.nc", "band.csv", "summary.txt", "watch.html"} <= set(os.listdir(folder))
    posterior = tb.read_result(folder / "posterior.nc")
    assert posterior.attrs["sampler"] == "sequential Monte Carlo"
    assert posterior.attrs["record_file"] == "live.csv"
    assert posterior["observed_data"].sizes["sample"] == 130
    assert commands.call("report", folder).exit_code == 0
    page = Page((folder / "report.html").read_text(encoding="utf-8"))
    assert any("particles" in words for words in page.texts["h3"])


@pytest.mark.slow
def test_its_page_loads_itself_again_until_the_end(path, follow, rows, measure):
    pages = []
    measure(rows[:4])

    def look():
        pages.append((path.parent / "run" / "watch.html").read_text(encoding="utf-8"))

    def grow():
        look()
        measure(rows[:50], ["broken\n"])

    follow("--poll", 3, then=[grow, look])
    look()
    first, middle, last = pages
    assert '<meta http-equiv="refresh" content="3">' in first
    assert "<strong>4 samples, 4 new.</strong>" in first
    assert '<meta http-equiv="refresh" content="3">' in middle
    assert "<strong>50 samples, 46 new.</strong>" in middle
    assert "there are 1 cells in 8 columns" in middle
    assert "refresh" not in last
    assert "<strong>Ended after 50 samples" in last
    assert 'id="band-detail"' in last


def test_each_update_is_a_line_for_programs(path, lines, follow, rows, measure):
    spoilt = [*rows[:30], rows[30].replace(rows[30].split(",")[6], "nan"), *rows[31:50]]
    measure(rows[:30])
    result = follow(json=True, then=[partial(measure, spoilt)])
    one, two, end = objects(result)
    assert [each["event"] for each in (one, two, end)] == ["update", "update", "end"]
    assert [(each["samples"], each["new"]) for each in (one, two)] == [(30, 30), (49, 19)]
    assert {row["quantity"] for row in two["quantities"]} == {"a", "q", "x_c", "noise_scale"}
    assert two["seconds_behind"] >= two["seconds"] > 0.0
    (warning,) = two["warnings"]
    assert re.search(rf"line {len(lines[0]) + 31}, column 'force_x': .*nan", warning)
    assert one["warnings"] == []
    assert warning in result.stderr
    assert (end["reason"], end["samples_taken"], end["converged"]) == ("no new rows for 0 s", 49, True)
    assert end["words"][0] == tb.check(tb.read_result(path.parent / "run" / "posterior.nc")).messages[0]


@pytest.mark.slow
def test_a_file_that_is_replaced_begins_again(path, follow, rows, measure):
    measure(rows[:40])
    result = follow(json=True, then=[measure, partial(measure, rows[5:30]), path.unlink, lambda: None])
    one, two, end = objects(result)
    assert (one["samples"], two["samples"], two["new"]) == (40, 25, 25)
    assert f"{path} has been replaced" in two["warnings"][0]
    assert end["samples_taken"] == 25


@pytest.mark.slow
def test_the_same_command_goes_on_with_the_same_numbers(path, follow, rows, measure):
    measure(rows[:30])
    first = follow(json=True)
    measure(rows[:60])
    resumed, grown, _ = objects(follow(json=True))
    assert (resumed["samples"], resumed["new"]) == (30, 0)
    assert resumed["quantities"] == objects(first)[0]["quantities"]
    measured = tb.read_record(path)
    expected = streamed(measured.isel(sample=slice(0, 30)), measured.isel(sample=slice(30, None)))
    assert [row["median"] for row in grown["quantities"]] == pytest.approx(expected, rel=1e-12)
    assert follow().stdout.startswith("60 samples, resumed; ")
    for change, words in ((["--seed", 2], "seed is"), (["--family", "circle"], "family is")):
        commands.assert_refused(follow(*change), words)
    measure(rows[1:70])
    commands.assert_refused(follow(), "record (its SHA-256)")
    measure(rows[:20])
    commands.assert_refused(follow(), "samples is 60 there and 20 here")


@pytest.mark.slow
def test_of_a_long_record_every_other_sample_is_taken(path, follow, rows, measure):
    """The posterior is that of a stream of these samples, also after a stop before they were too many."""
    assert 100 < len(rows) < 200
    some = ["--most-samples", 100]
    measure(rows[:90])
    first = objects(follow(*some, json=True))[0]
    assert (first["samples"], first["every"], first["warnings"]) == (90, 1, [])
    measure(rows)
    resumed, thinned, end = objects(follow(*some, json=True))
    assert (resumed["samples"], resumed["every"]) == (90, 1)
    half = (len(rows) + 1) // 2
    assert (thinned["samples"], thinned["new"], thinned["every"]) == (half, half, 2)
    assert not thinned["restarted"]
    assert any("one sample of 2" in words for words in thinned["warnings"])
    expected = streamed(tb.read_record(path).isel(sample=slice(None, None, 2)))
    assert [row["median"] for row in thinned["quantities"]] == pytest.approx(expected, rel=1e-12)
    assert end["samples_taken"] == half
    assert tb.read_result(path.parent / "run" / "posterior.nc").attrs["samples_taken_every"] == 2
    again, *_ = objects(follow(*some, json=True))
    assert (again["samples"], again["new"], again["every"]) == (half, 0, 2)
    said = follow(*some).stdout
    assert f"Ended after {half} samples, one of 2 " in said
    whole, *_ = objects(follow(json=True))[1:]
    assert (whole["samples"], whole["every"]) == (len(rows), 1)


@pytest.mark.slow
def test_samples_of_a_load_cell_that_drifts_are_all_taken(record, tmp_path):
    """The steps of its drift are those from one sample to the next; of another cell every other sample is taken."""
    measured = tb.read_record(record)
    steady = LoadCell.from_record(measured)
    size, options = measured.sizes["sample"], {"record_file": record, "rng": 1, "particles": 100}
    for cell, every in ((steady, 2), (replace(steady, drift=RandomWalk(force=1e-4)), 1)):
        rig = tb.Rig(load_cell=cell, unknown="nothing")
        with open_watch(tmp_path / f"run {every}", most_samples=100, rig=rig, **options) as watched:
            update = watched.take(measured, "")
        assert (update.samples, update.every) == (-(-size // every), every)


@pytest.mark.slow
def test_samples_that_do_not_go_on_in_order_are_taken_anew(follow, rows, measure):
    """The backward sweep, of which some samples came before, now with the whole forward sweep before them."""
    turn = next(k for k, row in enumerate(rows) if "backward" in row)
    measure(rows[:11], rows[12:13])
    result = follow(json=True, then=[partial(measure, rows[:11], rows[12:13], rows[11:12], rows[13:turn])])
    _, two, _ = objects(result)
    assert (two["samples"], two["new"], two["restarted"]) == (turn, turn, True)
    assert f"{turn} taken again" in two["warnings"][0]


@pytest.mark.slow
def test_it_ends_when_the_band_is_narrow(follow, rows, measure):
    measure(rows[:20])
    options = ("--between", "-0.02,0.02", "--until-width", 0.002)
    result = follow(*options, json=True, then=[partial(measure, rows), lambda: pytest.fail("goes on")])
    one, two, end = objects(result)
    assert (one["may_stop"], two["may_stop"]) == (False, True)
    assert one["band_width"] > 0.002 > two["band_width"]
    assert end["reason"] == "the band is narrow enough"


@pytest.mark.slow
def test_of_several_families_the_probabilities_are_told(path, follow, rows, measure):
    measure(rows[:60])
    options = ("--family", "circle", "--family", "parabola", "--until-probability", 0.9)
    one, end = objects(follow(*options, json=True, then=[lambda: pytest.fail("goes on")]))
    assert list(one["probabilities"]) == ["circle", "parabola"]
    assert sum(one["probabilities"].values()) == pytest.approx(1.0)
    assert one["probabilities"]["parabola"] > 0.9
    assert {row["quantity"] for row in one["quantities"]} == {"a", "q", "x_c", "noise_scale"}
    assert end["reason"] == "parabola is probable enough"
    said = follow(*options).stdout.splitlines()
    assert said[0].startswith("60 samples, resumed; band up to ")
    assert said[1].startswith("    Probability of the shapes: parabola ")
    assert "Probability of the shapes" in (path.parent / "run" / "watch.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_wrong_model_is_told_once(path, follow, tmp_path):
    """Friction that is not inferred."""
    cell = LoadCell(force_noise=0.05, moment_noise=0.02)
    record = cell.measure(
        tb.scan(paper_profile("II", q=0.5), drive_step=0.05, rig=tb.Rig(unknown={"friction": 0.2})).record, rng=1
    )
    tb.write_record(record.isel(sample=slice(0, 60)), tmp_path / "whole.csv")
    text = (tmp_path / "whole.csv").read_text(encoding="utf-8").splitlines(keepends=True)

    def leave(count):
        path.write_text("".join(text[: len(text) - count]), encoding="utf-8")

    leave(45)
    result = follow(then=[partial(leave, count) for count in (30, 15, 0)])
    assert result.exit_code == 0
    assert result.stderr.count("(e-value ") == 1
    assert "[unknown] of rig.toml" in result.stderr


@pytest.mark.slow
def test_no_family_is_probable_while_an_evidence_is_too_small(follow, monkeypatch, rows, measure):
    monkeypatch.setattr(watch, "LOST_ONCE", -1.0)
    measure(rows[:60])
    options = ("--family", "circle", "--family", "parabola", "--until-probability", 0.9)
    said = follow(*options).stdout
    assert "; too small for circle, parabola: " in said
    assert "60 samples: no new rows" in said


def test_control_c_ends_it_with_the_answer(path, as_stated, monkeypatch, rows, measure):
    measure(rows[:10])
    monkeypatch.setattr(watching.time, "sleep", lambda seconds: os.kill(os.getpid(), signal.SIGINT))
    result = commands.call("watch", path, "--out", path.parent / "run", "--rig", as_stated, *FEW)
    assert result.exit_code == 0
    assert "10 samples: stopped by Ctrl-C or a signal.\n" in result.stdout
    path.unlink()
    result = commands.call("watch", path, "--out", path.parent / "other", "--rig", as_stated, *FEW)
    assert result.exit_code == 130
    assert "interrupted before" in result.stderr


def test_quiet_prints_the_answer_alone_and_warns_of_few_particles(follow, rows, measure):
    measure(rows[:10])
    result = follow("--quiet", "--particles", 100)
    assert result.stdout.startswith("Ended after ")
    assert re.search("100 particles .* 4 parameters.* --particles 120", result.stderr)


def test_a_file_without_samples_is_refused(path, follow, measure):
    commands.assert_refused(follow(), path, "no new rows", "no sample")
    measure()
    commands.assert_refused(follow(), path, "no sample")
    path.write_text("drive_angle,force_x\n1.0,2.0\n", encoding="utf-8")
    commands.assert_refused(follow(), "no column 'sweep'")


@pytest.mark.slow
def test_a_rig_that_writes_100_rows_a_second(path, lines, as_stated):
    """In real time, with lines that are half written at any moment."""
    head, rows = lines

    def measure():
        with open(path, "w", encoding="utf-8", buffering=1) as file:
            file.writelines(head)
            for row in rows[:60]:
                file.write(row[: len(row) // 2])
                file.flush()
                time.sleep(0.005)
                file.write(row[len(row) // 2 :])
                time.sleep(0.005)

    rig = threading.Thread(target=measure)
    rig.start()
    out = path.parent / "run"
    result = commands.call(
        "watch", path, "--out", out, "--rig", as_stated, *FEW, "--poll", 0.05, "--idle", 0.4, "--json"
    )
    rig.join()
    *updates, end = objects(result)
    assert end["samples_taken"] == updates[-1]["samples"] == 60
    assert sum(each["new"] for each in updates) == 60
    assert any(each["taken_together"] for each in updates)
    assert result.stderr == ""
