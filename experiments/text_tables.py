"""Tables as text files, in whatever encoding a spreadsheet or tracker wrote them."""

import codecs
import re
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from experiments.errors import InputError

_MARKS = (
    (codecs.BOM_UTF32_LE, "UTF-32"),
    (codecs.BOM_UTF32_BE, "UTF-32"),
    (codecs.BOM_UTF16_LE, "UTF-16"),
    (codecs.BOM_UTF16_BE, "UTF-16"),
)
"""Byte order marks of encodings that spreadsheets write besides UTF-8, the longer first."""
HEAD_BYTES = 1 << 16
"""Bytes in which one line or more ends, in nearly every table."""
_SEPARATORS = ",;\t"
_QUOTED = re.compile(r'"[^"]*"')


def utf8_stream(path: Path) -> BinaryIO:
    """The file as UTF-8, opened; UTF-16 and UTF-32, with a byte order mark or without, are converted.

    Lines that end in a carriage return alone, as of old Macs and of Excel's "CSV (Macintosh)", end in a line
    feed instead.

    Raises
    ------
    InputError
        The file is not text in the encoding that its first bytes announce.
    """
    with path.open("rb") as file:
        start = file.read(HEAD_BYTES)
    encoding = next((name for mark, name in _MARKS if start.startswith(mark)), None) or _without_mark(start)
    if encoding is None:
        if b"\0" in start:
            raise InputError(f"{path.name} is not UTF-8 text (it holds null bytes); save it as CSV UTF-8")
        if b"\r" not in start or b"\n" in start:
            return path.open("rb")
        return BytesIO(_with_line_feeds(path.read_bytes()))
    try:
        text = path.read_bytes().decode(encoding)
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path.name} is not {encoding} text ({error.reason}); save it as CSV UTF-8"
        ) from error
    return BytesIO(_with_line_feeds(text.encode()))


def whole_text_of(path: Path) -> str:
    """The text of a whole table file.

    Raises
    ------
    InputError
        The file is not text in UTF-8, UTF-16 or UTF-32.
    """
    with utf8_stream(path) as stream:
        data = stream.read()
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path.name} is not UTF-8 text ({error.reason}); save it as CSV UTF-8") from error


def separator_of(header: str) -> str:
    """The separator of a header line: the most frequent of comma, semicolon and tab outside quotes."""
    return max(_SEPARATORS, key=_QUOTED.sub("", header).count)


def _without_mark(start: bytes) -> str | None:
    """UTF-16 or UTF-32 by where the null bytes of its plain letters are; None for other texts."""
    part = start[:256]
    if len(part) < 4 or b"\0" not in part:
        return None
    empty = [part[offset::4].count(0) / len(part[offset::4]) for offset in range(4)]
    if min(empty[1:]) > 0.9 and empty[0] < 0.1:
        return "UTF-32-LE"
    if min(empty[:3]) > 0.9 and empty[3] < 0.1:
        return "UTF-32-BE"
    if min(empty[1], empty[3]) > 0.7 and max(empty[0], empty[2]) < 0.1:
        return "UTF-16-LE"
    if min(empty[0], empty[2]) > 0.7 and max(empty[1], empty[3]) < 0.1:
        return "UTF-16-BE"
    return None


def _with_line_feeds(data: bytes) -> bytes:
    return data if b"\n" in data else data.replace(b"\r", b"\n")
