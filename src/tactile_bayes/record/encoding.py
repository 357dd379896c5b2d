"""The encoding of a CSV file: what a file is that is no text in UTF-8."""

from __future__ import annotations

import codecs

from tactile_bayes.record.table import Source

__all__ = ["not_utf8", "refuse_other_kinds"]

_SAVE = "save it as CSV in UTF-8"
_BINARY = {
    b"\x89HDF\r\n\x1a\n": "a NetCDF (HDF5) file: rename it to end in .nc",
    **dict.fromkeys(
        (b"CDF\x01", b"CDF\x02", b"CDF\x05"),
        "a NetCDF file of the classic kind: convert it to NetCDF-4 (nccopy -k nc4), with a name that ends in .nc",
    ),
    b"PK\x03\x04": f"a workbook of a spreadsheet, or another zip archive: {_SAVE}",
}
_MARKS = {  # the longer one first, which begins like the shorter one
    codecs.BOM_UTF32_LE: "UTF-32",
    codecs.BOM_UTF32_BE: "UTF-32",
    codecs.BOM_UTF16_LE: "UTF-16",
    codecs.BOM_UTF16_BE: "UTF-16",
}


def refuse_other_kinds(start: bytes, source: Source) -> None:
    """Refuse a file that shows by its first bytes what else it is."""
    for mark, what in _BINARY.items():
        if start.startswith(mark):
            raise source.error(f"this is no CSV file, but {what}")
    for mark, encoding in _MARKS.items():
        if start.startswith(mark):
            raise source.error(f"the file is {encoding} text, as its first bytes say: {_SAVE}")
    if b"\0" in start[:2]:
        raise source.error(f"the file is no UTF-8 text, but looks like UTF-16: {_SAVE}")


def not_utf8(error: UnicodeDecodeError) -> str:
    """Why bytes are no text in UTF-8, and what to do."""
    byte = error.object[error.start : error.start + 1]
    character = byte.decode("cp1252", "ignore")
    reading = f", {character!r} in Windows-1252" if character else ""
    return f"the file is not UTF-8 text (byte 0x{byte.hex()}{reading}): {_SAVE}"
