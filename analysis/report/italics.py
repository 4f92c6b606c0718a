"""Which letters are symbols of statistics, which APA style sets in italics, and which hyphens are minus."""

import re
from collections.abc import Sequence

_SYMBOL = re.compile(r"(?<![\w'’])(?:SE|SD|[FtpMNnzrdWVqb])(?=(?:\([\d., ]+\))? ?[=<>≤≥] ?[-−]?[\d.])")
_HEADING = re.compile(r"(?<![\w/'’])(?:SE|SD|SS|MS|df|dz|BF|[FtpnzrWb])(?![A-Za-z0-9_/'’])")
_TESTS = re.compile(r"\b(?:df|p)\b|BF")
_MINUS = re.compile(r"(?<![\w./])-(?=\.?\d[\d.]*+(?>(?:e[-+]?\d++)?)(?!\w))")
_LETTER = re.compile(r"(?!(?<=\d)e[-+]?\d)[^\W\d_]|[/_]")


def pieces(text: str) -> list[tuple[str, bool]]:
    """The text in pieces; True where one is the symbol of a statistic.

    Examples
    --------
    >>> pieces("F(1, 18) = 4.50, p = .048")
    [('F', True), ('(1, 18) = 4.50, ', False), ('p', True), (' = .048', False)]
    """
    return _split(text, _SYMBOL)


def heading_pieces(header: Sequence[str]) -> list[list[tuple[str, bool]]]:
    """The heads of a table's columns in pieces; True where one is the symbol of a statistic.

    A level may be called F or t: alone such a letter is a symbol beside a p or degrees of freedom only, and
    what follows a colon is a level.

    Examples
    --------
    >>> heading_pieces(["Effect", "p (ranks)"])
    [[('Effect', False)], [('p', True), (' (ranks)', False)]]
    >>> heading_pieces(["Gender", "F"])
    [[('Gender', False)], [('F', False)]]
    """
    tests = any(_TESTS.search(head) for head in header)
    return [
        [(head, False)] if ":" in head or (len(head) == 1 and not tests) else _split(head, _HEADING)
        for head in header
    ]


def signed(text: str) -> str:
    """The text with a minus sign, no hyphen, before negative numbers; -3dB is a name."""
    return _MINUS.sub("−", text)


def signed_cell(cell: str, numeric: bool) -> str:
    """A table's cell with minus signs where it holds numbers alone; ids and labels keep their hyphens.

    Examples
    --------
    >>> signed_cell("-0.31 (0.12)", True), signed_cell("id -7", True), signed_cell("-7", False)
    ('−0.31 (0.12)', 'id -7', '-7')
    """
    return signed(cell) if numeric and not _LETTER.search(cell) else cell


def _split(text: str, symbols: re.Pattern[str]) -> list[tuple[str, bool]]:
    split, at = list[tuple[str, bool]](), 0
    for symbol in symbols.finditer(text):
        split += [(text[at : symbol.start()], False), (symbol[0], True)]
        at = symbol.end()
    return [piece for piece in (*split, (text[at:], False)) if piece[0]]
