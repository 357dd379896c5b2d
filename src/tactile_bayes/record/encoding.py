"""The encoding of a CSV file: UTF-8 or Windows-1252; other files are recognised and refused."""

from __future__ import annotations

import codecs
import io
import re
from typing import BinaryIO

from tactile_bayes.record.table import Source

CUT_BY_NUL = (
    "from here on there are NUL characters (0x00) alone, as a power failure leaves them: remove them and this row"
)
WITH_NUL = "there is a NUL character (0x00), which is no text: remove it"
_CHUNK = 1 << 21
_SAVE = "save it as CSV in UTF-8"
_BEYOND_ASCII = re.compile("[^\0-\x7f]")
# What the first bytes of other files show; a longer mark precedes a shorter one with the same beginning.
_NO_CSV, _WIDE = "this is no CSV file, but {}", f"the file is {{}} text, as its first bytes say: {_SAVE}"
_CLASSIC = "a NetCDF file of the classic kind: convert it to NetCDF-4 (nccopy -k nc4), with a name that ends in .nc"
_MARKS = {
    b"\x89HDF\r\n\x1a\n": _NO_CSV.format("a NetCDF (HDF5) file: rename it to end in .nc"),
    **dict.fromkeys((b"CDF\x01", b"CDF\x02", b"CDF\x05"), _NO_CSV.format(_CLASSIC)),
    b"PK\x03\x04": _NO_CSV.format(f"a workbook of a spreadsheet, or another zip archive: {_SAVE}"),
    **dict.fromkeys((codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE), _WIDE.format("UTF-32")),
    **dict.fromkeys((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE), _WIDE.format("UTF-16")),
}


def refuse_other_kinds(start: bytes, source: Source) -> None:
    """Refuse a file whose first bytes show another format."""
    for mark, what in _MARKS.items():
        if start.startswith(mark):
            raise source.error(what)
    if b"\0" in start[:2]:
        raise source.error(f"the file is no UTF-8 text, but looks like UTF-16: {_SAVE}")


def in_utf8(file: BinaryIO) -> BinaryIO:
    """Return the file, or a copy in UTF-8 if it is text in Windows-1252; damaged UTF-8 stays as it is."""
    decoder = codecs.getincrementaldecoder("utf-8")()
    try:
        for block in iter(lambda: file.read(_CHUNK), b""):
            decoder.decode(block)
        decoder.decode(b"", final=True)
    except UnicodeDecodeError:
        file.seek(0)
        if (copy := _from_windows(file.read())) is not None:
            return io.BytesIO(copy)
    file.seek(0)
    return file


def _from_windows(content: bytes) -> bytes | None:
    """Convert content from Windows-1252 to UTF-8; None if it is something else, like damaged UTF-8."""
    if b"\0" in content or content.startswith(codecs.BOM_UTF8):
        return None
    beyond = _BEYOND_ASCII.findall(content.decode("utf-8", "surrogateescape"))
    damaged = sum("\ud800" <= sign <= "\udfff" for sign in beyond)
    if 2 * damaged < len(beyond):
        return None
    try:
        return content.decode("cp1252").encode()
    except UnicodeDecodeError:
        return None


def not_utf8(error: UnicodeDecodeError) -> str:
    """Message for bytes that are neither UTF-8 nor Windows-1252."""
    byte = error.object[error.start : error.start + 1]
    character = byte.decode("cp1252", "ignore")
    reading = f", {character!r} in Windows-1252" if character else ""
    return f"the file is not UTF-8 text (byte 0x{byte.hex()}{reading}): {_SAVE}"
