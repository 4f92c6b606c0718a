"""Which letters of a sentence are symbols of statistics, which APA style sets in italics."""

import re

_SYMBOL = re.compile(r"(?<![\w'’])(?:SE|SD|[FtpMNnzrdWVq])(?=(?:\([\d., ]+\))? ?[=<>≤≥] ?[-−]?[\d.])")


def pieces(text: str) -> list[tuple[str, bool]]:
    """The text in pieces; True where one is the symbol of a statistic.

    Examples
    --------
    >>> pieces("F(1, 18) = 4.50, p = .048")
    [('F', True), ('(1, 18) = 4.50, ', False), ('p', True), (' = .048', False)]
    """
    split, at = list[tuple[str, bool]](), 0
    for symbol in _SYMBOL.finditer(text):
        split += [(text[at : symbol.start()], False), (symbol[0], True)]
        at = symbol.end()
    return [piece for piece in (*split, (text[at:], False)) if piece[0]]
