"""JSON and TOML texts: what is too deep is refused at once, and brackets in strings do not count."""

import json
import time
from functools import partial

import pytest

from tactile_bayes.errors import ParameterError
from tactile_bayes.tasks.documents import LARGEST, read_json, read_toml

DEEP = 100_000


JSON = [
    "[" * DEEP,
    "[" * DEEP + "]" * DEEP,
    '{"a":' * DEEP,
    '[{"a":' * DEEP + "1",
    '["a]", ' * DEEP,
    b"[" * DEEP,
    '"' + "[" * DEEP,
    "1" * 5000,
    '{"a": 1',
    b"\xff",
    None,
    3,
    "\ufeff1",
]
TOML = [
    "a = " + "[" * DEEP,
    "a = " + "{a = " * DEEP,
    ".".join("a" * 2000) + " = 1",
    "[" + ".".join("a" * 2000) + "]",
    " . ".join(['"a b"', "'c'"] * 1000) + " = 1",
    "a = '''" + "[" * DEEP,
    'a = """' + '\\"""' * DEEP,
    "a = " + "1" * 5000,
    "a = 1\n" * 2,
    "#" * (LARGEST + 1),
]


@pytest.mark.parametrize(
    ("read", "text"),
    [*((partial(read_json, name="priors"), text) for text in JSON), *((read_toml, text) for text in TOML)],
    ids=lambda value: str(value)[:12],
)
def test_a_text_that_cannot_be_read_is_refused_at_once(read, text):
    began = time.thread_time()
    with pytest.raises(ParameterError, match=None if read is read_toml else r"^priors is "):
        read(text)
    assert time.thread_time() - began < 5.0


def test_brackets_and_dots_in_strings_and_comments_do_not_count():
    many = "[{" * 1000 + "." * 1000
    assert read_json(json.dumps({"a": many, many: ['"\\']}), "it") == {"a": many, many: ['"\\']}
    text = f"a = \"{many}\"\nb = '{many}'\nc = '''\n{many}'''\nd = \"\"\"{many}\"\"\"\n# {many}\n'{many}' = 1\n"
    assert read_toml(text) == {"a": many, "b": many, "c": many, "d": many, many: 1}


def test_a_long_text_is_read_as_such():
    rows = [{"number": number, "width": [0.5, None]} for number in range(20_000)]
    assert read_json(json.dumps(rows), "it") == rows
    assert read_toml("each = [" + "1.5, " * 50_000 + "]")["each"] == [1.5] * 50_000
