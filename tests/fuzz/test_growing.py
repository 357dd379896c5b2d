"""Files that grow, in every state in which they may be found: what is read is what is there."""

import os

import numpy as np
import xarray as xr

from helpers.mutations import pick
from helpers.record_tables import WIRE, columns
from tactile_bayes.record import write_record
from tactile_bayes.rig import GrowingRecord, Rig, make_record

CASES, STEPS = 6, 10  # number of files that grow, and what happens to each
FAULTS = (b"\n", b"# note\n", b"7,sideways,1,2\n", b"0,forward,nan,,,,,\n", b'"\n', b"\0\0\0\n", b"0;1\n")


def content_of(rng, path):
    """The content of a record with texts, some of them over several lines, and rows that no record can have."""
    count = int(rng.integers(3, 30))
    angles = np.sort(rng.uniform(1.0, 2.0, count))
    loads = {name: rng.normal(size=count) for name in ("holding_moment", "force_x", "force_y")}
    notes = rng.choice(["", "a", "two\nlines", 'a "word", or two', "ß€"], count)
    table = columns(sweep=0, direction="forward", base_x=0.0, base_y=0.25, drive_angle=angles, note=notes, **loads)
    write_record(make_record(table, Rig(rod=WIRE)), path)
    lines = path.read_bytes().splitlines(keepends=True)
    for _ in range(int(rng.integers(0, 3))):
        lines.insert(int(rng.integers(len(lines) - count, len(lines) + 1)), pick(rng, FAULTS))
    end = b"\r\n" if rng.random() < 0.2 else b"\n"
    return b"".join(lines).replace(b"\n", end)


def changed(rng, path, rest):
    """Let one thing happen to a file, and return what is still to be written to it."""
    match int(rng.integers(8)):
        case 0:
            path.unlink(missing_ok=True)
            return content_of(rng, path.with_name("next.csv"))
        case 1:
            other = path.with_name("next.csv")
            content = content_of(rng, other)
            at = int(rng.integers(len(content)))
            other.write_bytes(content[:at])
            os.replace(other, path)
            return content[at:]
        case 2:
            if path.exists():
                os.truncate(path, int(rng.integers(path.stat().st_size + 1)))
            return rest
        case 3:
            if path.exists():  # in place, of the same size
                content = bytearray(path.read_bytes())
                digits = [at for at, sign in enumerate(content) if sign in b"0123456789"]
                for at in rng.permutation(digits)[:1]:
                    content[at] = pick(rng, b"0123456789")
                path.write_bytes(content)
            return rest
        case _:
            size = int(rng.integers(1, 4)) if rng.random() < 0.3 else int(rng.integers(len(rest) + 1))
            with open(path, "ab") as file:
                file.write(rest[:size])
            return rest[size:]


def told(growth):
    """What is known of a file: its record, or why there is none."""
    if growth is None:
        return None
    return growth.sha256, None if growth.error is None else str(growth.error), growth.record


def test_a_file_that_grows_is_read_as_the_whole_file_is(tmp_path, fuzz_seed):
    rng, read = np.random.default_rng(fuzz_seed), 0
    for number in range(CASES):
        path = tmp_path / f"{number}" / "record.csv"
        path.parent.mkdir()
        growing, last = GrowingRecord(path, Rig(file={"missing": ()})), None
        rest = content_of(rng, path.with_name("next.csv"))
        for _ in range(STEPS):
            rest = changed(rng, path, rest)
            if rng.random() < 0.3:
                continue
            growth = growing.poll()
            last = growth if growth is not None else last
            if not path.exists():
                continue
            whole = GrowingRecord(path).poll()
            found, expected = told(last), told(whole)
            if expected is None:  # no whole line yet
                continue
            assert found[:2] == expected[:2]
            assert (found[2] is None) == (expected[2] is None)
            if found[2] is not None:
                read += 1
                xr.testing.assert_identical(found[2], expected[2])
    assert read
