"""Which letters are symbols of statistics, which APA style sets in italics, and which hyphens are minus."""

import re

_SYMBOL = re.compile(r"(?<![\w'’])(?:SE|SD|[FtpMNnzrdWVqb])(?=(?:\([\d., ]+\))? ?[=<>≤≥] ?[-−]?[\d.])")
_HEADING = re.compile(r"(?<![\w/'’])(?:SE|SD|SS|MS|df|dz|BF|[FtpMNnzrdWVb])(?![A-Za-z0-9_/'’])")
_MINUS = re.compile(r"(?<![\w.])-(?=\.?\d)")


def pieces(text: str) -> list[tuple[str, bool]]:
    """The text in pieces; True where one is the symbol of a statistic.

    Examples
    --------
    >>> pieces("F(1, 18) = 4.50, p = .048")
    [('F', True), ('(1, 18) = 4.50, ', False), ('p', True), (' = .048', False)]
    """
    return _split(text, _SYMBOL)


def heading_pieces(text: str) -> list[tuple[str, bool]]:
    """The head of a column in pieces; True where one is the symbol of a statistic.

    Examples
    --------
    >>> heading_pieces("p (ranks)")
    [('p', True), (' (ranks)', False)]
    """
    return _split(text, _HEADING)


def signed(text: str) -> str:
    """The text with a minus sign, no hyphen, before negative numbers."""
    return _MINUS.sub("−", text)


def _split(text: str, symbols: re.Pattern[str]) -> list[tuple[str, bool]]:
    split, at = list[tuple[str, bool]](), 0
    for symbol in symbols.finditer(text):
        split += [(text[at : symbol.start()], False), (symbol[0], True)]
        at = symbol.end()
    return [piece for piece in (*split, (text[at:], False)) if piece[0]]
