"""The standard streams: every text arrives, whatever their encoding."""

from __future__ import annotations

import codecs
import io
import sys
import unicodedata

_HANDLER = "tactile_bayes.stand_in"

# Name of ASCII for streams, under which Typer does not take it for a mistake and write UTF-8.
_ASCII = "tactile_bayes_ascii"
# Characters, each before its stand-in.
_PAIRS = """
− - – - — - • * ° deg ± +/- × x · . ⋅ . ⁄ / √ sqrt ∞ inf ∂ d ∫ int ′ ' ≤ <= ≥ >= ≠ != ≈ ~ ∈ in → -> ⟹ =>
‘ ' ’ ' “ " ” " \N{MICRO SIGN} u \N{GREEK SMALL LETTER MU} u \N{COMBINING CIRCUMFLEX ACCENT} ^
"""
_WORDS = _PAIRS.split()
_STAND_INS = dict(zip(_WORDS[::2], _WORDS[1::2], strict=True))


def accept_every_text() -> None:
    """Have stdout and stderr write a readable stand-in for each character that their encoding lacks."""
    codecs.register_error(_HANDLER, _encoded_by_stand_ins)
    codecs.register(_ascii_codec)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            is_ascii = codecs.lookup(stream.encoding).name == "ascii"
            stream.reconfigure(encoding=_ASCII if is_ascii else None, errors=_HANDLER)


def _ascii_codec(name: str) -> codecs.CodecInfo | None:
    if name != _ASCII:
        return None
    known = codecs.lookup("ascii")
    return codecs.CodecInfo(*known, known.incrementalencoder, known.incrementaldecoder, _ASCII)


def _encoded_by_stand_ins(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(_stand_in, error.object[error.start : error.end])), error.end


def _stand_in(character: str) -> str:
    """Return ASCII for a character: a sign like it, the name of a Greek letter, or the letter without its accents."""
    if character in _STAND_INS:
        return _STAND_INS[character]
    code = ord(character)
    if 0xDC80 <= code <= 0xDCFF:  # a byte in the name of a file that is no text
        return f"\\x{code - 0xDC00:02x}"
    name = unicodedata.name(character, "").split()
    if name[:1] == ["GREEK"]:
        letter = name[3] if name[2:3] == ["LETTER"] else name[1]
        return letter.capitalize() if "CAPITAL" in name else letter.lower()
    power = "^" if unicodedata.decomposition(character).startswith("<super>") else ""
    parts = unicodedata.normalize("NFKD", character)
    plain = "".join(part if part.isascii() else _STAND_INS.get(part, "") for part in parts if part != character)
    return power + plain if plain else "?"
