"""Results arrive on every stream: what its encoding lacks has a readable stand-in, and JSON is ASCII."""

import io
import json
import os
import subprocess
import sys
import tomllib
from contextlib import contextmanager
from pathlib import Path

import pytest

from tactile_bayes.cli import app
from tactile_bayes.cli.app import accept_every_text

ENCODINGS = ["ascii", "cp1252", "cp437", "latin-1", "koi8-r", "shift_jis", "utf-8"]

COMMAND = [sys.executable, "-m", "tactile_bayes.cli"]
QUICK = [*COMMAND, "dataset", "example"]


@contextmanager
def streams(encoding):
    """Streams of this encoding in place of stdout and stderr; yields what has been written to each at the end."""
    before, written = (sys.stdout, sys.stderr), []
    sys.stdout, sys.stderr = (io.TextIOWrapper(io.BytesIO(), encoding=encoding) for _ in before)
    try:
        accept_every_text()
        yield written
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
            written.append(stream.buffer.getvalue())
    finally:
        sys.stdout, sys.stderr = before


def called(encoding, *words):
    with streams(encoding) as written:
        app([str(word) for word in words], standalone_mode=False)
    return written


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_every_sign_arrives(encoding):
    """Of all planes that the package may ever use, and bytes of file names that are no text."""
    signs = "".join(map(chr, [*range(32, 0x3000), *range(0xDC80, 0xDD00)]))
    with streams(encoding) as written:
        print(signs)
        print(signs, file=sys.stderr)
    assert written[0] == written[1]
    assert "R" in written[0].decode(encoding)


@pytest.mark.parametrize(
    ("encoding", "text", "expected"),
    [
        (
            "ascii",
            "R̂ 28.0° −3 ± 2 µN, Δκ₀ ≥ ½ N m², “é” ⁻¹ 日 \udcff",
            'R^ 28.0deg -3 +/- 2 uN, Deltakappa0 >= 1/2 N m^2, "e" ^-^1 ? \\xff',
        ),
        ("cp1252", "28.0° ± 2 µN m²", "28.0° ± 2 µN m²"),
        ("utf-8", "28.0° ± 2 µN m²", "28.0° ± 2 µN m²"),
    ],
)
def test_stand_ins_can_be_read_and_what_an_encoding_has_stays_as_it_is(encoding, text, expected):
    with streams(encoding) as written:
        print(text)
    assert written[0] == f"{expected}\n".encode(encoding)


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "utf-8"])
def test_results_arrive(encoding, record, tmp_path):
    """Tables and help in the encoding of the stream, JSON and TOML in ASCII on every stream."""
    path = tmp_path / "°.csv"
    path.write_bytes(record.read_bytes())
    for words, part in ((("inspect", record), "lets go"), (("infer", "--help"), "Usage: ")):
        written, errors = called(encoding, *words)
        assert errors == b""
        assert part in written.decode(encoding)
    written, _ = called(encoding, "inspect", path, "--json")
    assert str(path) in json.loads(written.decode("ascii"))["next"]
    written, _ = called(encoding, "dataset", "example")
    assert tomllib.loads(written.decode("ascii"))


def test_a_process_with_the_locale_of_c():
    variables = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    words = ["measure", "--help"]
    done = subprocess.run([*COMMAND, *words], capture_output=True, env=os.environ | variables, check=True)
    assert not called("utf-8", *words)[0].isascii()
    assert done.stdout.isascii()
    assert done.stderr == b""
    assert b"Usage: " in done.stdout


@pytest.mark.skipif(sys.platform == "win32", reason="pipes end otherwise there")
def test_a_reader_that_goes_away_ends_the_command_quietly(tmp_path):
    with (
        (tmp_path / "errors").open("wb") as errors,
        subprocess.Popen(QUICK, stdout=subprocess.PIPE, stderr=errors) as process,
    ):
        process.stdout.close()
    assert (tmp_path / "errors").read_bytes() == b""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is always full")
def test_a_full_disk_behind_the_stream_is_named():
    with open("/dev/full", "wb") as full:
        done = subprocess.run(QUICK, stdout=full, stderr=subprocess.PIPE, check=False)
    assert (done.returncode, done.stderr) == (2, b"tactile-bayes: No space left on device\n")
