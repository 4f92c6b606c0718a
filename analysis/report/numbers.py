"""How numbers are printed: in tables and, in APA style, in sentences."""

import math
import re
from collections.abc import Iterable, Sequence
from decimal import ROUND_HALF_UP, Decimal

DASH = "–"
"""Printed where a number does not exist."""

SMALLEST_P = 0.001
"""Below this only `<.001` is printed, in tables as in sentences."""


def fixed(value: float, digits: int = 2) -> str:
    """`value` with a fixed number of decimals; a dash where it does not exist; no negative zero."""
    if not math.isfinite(value):
        return DASH
    text = f"{value:.{digits}f}"
    # Half away from zero on the decimal number: 71.755 may be stored as 71.75499999999998. Larger numbers
    # have no digits to spare.
    if abs(value) < 1e6:
        text = f"{Decimal(f'{value:.14g}').quantize(Decimal(1).scaleb(-digits), ROUND_HALF_UP):f}"
    # A small negative number may round to -0.00.
    return text.lstrip("-") if float(text) == 0 else text


def decimals(errors: Iterable[float | None], otherwise: int = 3) -> int:
    """Decimals that show two digits of the smallest of standard errors; `otherwise` where none is above 0.

    Examples
    --------
    >>> decimals([4.1, 12.0]), decimals([0.0032, None]), decimals([])
    (1, 4, 3)
    """
    known = [error for error in errors if error is not None and 0 < error < math.inf]
    if not known:
        return otherwise
    return min(max(1 - math.floor(math.log10(min(known))), 0), 6)


def mean_digits(errors: Iterable[float]) -> int:
    """Decimals of means: two, or more where all their standard errors would be 0.00 (seconds, meters).

    Examples
    --------
    >>> mean_digits([0.19, 0.004]), mean_digits([0.0036, 0.0042]), mean_digits([0.0, 0.0])
    (2, 4, 2)
    """
    largest = max((error for error in errors if math.isfinite(error)), default=0.0)
    return decimals([largest], 2) if largest < 0.01 else 2


def share(value: float, digits: int = 3) -> str:
    """A number that cannot exceed 1, without its leading zero, as APA has it."""
    text = fixed(value, digits)
    return text.replace("0.", ".", 1) if text.startswith(("0.", "-0.")) else text


def p_value(value: float) -> str:
    """p with three decimals and no leading zero; `<.001` below that."""
    if not math.isfinite(value):
        return DASH
    return "<.001" if value < SMALLEST_P else share(value)


def apa_p(value: float) -> str:
    """p as written in a sentence: `p = .020`, `p < .001`."""
    if not math.isfinite(value):
        return "p undefined"
    text = p_value(value)
    return f"p < {text[1:]}" if text.startswith("<") else f"p = {text}"


def f_text(value: float) -> str:
    """F with three decimals, fewer where it is large."""
    return fixed(value, 3 if abs(value) < 1000 else 1)


def sum_digits(values: Iterable[float]) -> int:
    """Decimals for a column of sums of squares: two, or four digits of the largest where that needs more.

    Examples
    --------
    >>> sum_digits([71.8, 0.02]), sum_digits([0.0123]), sum_digits([])
    (2, 5, 2)
    """
    largest = max((abs(value) for value in values if math.isfinite(value)), default=0.0)
    return min(max(2, 3 - math.floor(math.log10(largest))), 6) if largest else 2


def interval(bounds: tuple[float, float], digits: int = 2) -> str:
    """A confidence interval in brackets."""
    low, high = bounds
    return f"[{fixed(low, digits)}, {fixed(high, digits)}]" if math.isfinite(low) else DASH


def as_given(bounds: tuple[float, float]) -> str:
    """Bounds that were chosen, with every decimal they have and at least two.

    Examples
    --------
    >>> as_given((-0.5, 0.5)), as_given((-0.005, 0.0125))
    ('[-0.50, 0.50]', '[-0.0050, 0.0125]')
    """
    decimals_given = (len(f"{bound:.6f}".rstrip("0").partition(".")[2]) for bound in bounds)
    return interval(bounds, max(2, *decimals_given))


def share_interval(bounds: tuple[float, float]) -> str:
    """A confidence interval of a share, without leading zeros."""
    low, high = bounds
    return f"[{share(low, 2)}, {share(high, 2)}]" if math.isfinite(low) else DASH


# Which letters are symbols of statistics, which APA style sets in italics, and which hyphens are minus.

_SYMBOL = re.compile(r"(?<![\w'’])(?:SE|SD|[FtpMNnzrdWVqb])(?=(?:\([\d.,\s]+\))?\s?[=<>≤≥]\s?[-−]?[\d.√])")
_HEADING = re.compile(r"(?<![\w/'’])(?:SE|SD|SS|MS|df|dz|BF|[FtpnzrWb])(?![A-Za-z0-9_/'’])")
# In what the report says of itself, where a level may be called F: letters next to words of tests alone.
_NOTED = re.compile(
    r"(?<![\w/'’])(?:(?:SE|SD|SS|df|dz)(?![\w/'’])|BF(?=[₀₁])"
    r"|[FtpzW](?=: [A-Za-z]| (?:tests?|values?|intervals?|adjusted|belongs|with|on|of|in the|is|use)\b)"
    r"|(?<=exact )F|(?<=variate )F|(?<=The )F(?= reported)"
    r"|[FPV](?=\([xzPR(])|[FP](?=(?: the)? normal)"
    r"|(?<=\()q(?=, )|N(?= − q)|(?<=N − )q(?=\)))"
)
_TOGETHER = re.compile(
    r"(?<![\w'’])(?:[A-Za-z]{1,2}|[ηωε]ₚ?²?|χ²|BF₁₀)(?:\([\d., ]+\))? [=<>≤≥] (?=[-−]?[\d.√])"
    r"|\d% CI \[[^]]*\]"
)
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


def note_pieces(text: str) -> list[tuple[str, bool]]:
    """A note in pieces, where symbols also occur without a number, and a hyphen between spaces is a minus.

    Examples
    --------
    >>> note_pieces("SE: of means. Paired t tests; p adjusted; level F and point p.")[:4]
    [('SE', True), (': of means. Paired ', False), ('t', True), (' tests; ', False)]
    """
    return [
        one
        for piece, is_symbol in _split(text.replace(" - ", " − "), _SYMBOL)
        for one in ([(piece, True)] if is_symbol else _split(piece, _NOTED))
    ]


def unbroken(text: str) -> str:
    """The text with spaces inside a statistic at which no line ends.

    Examples
    --------
    >>> unbroken("so p = .04, of a").split(" ")
    ['so', 'p\\xa0=\\xa0.04,', 'of', 'a']
    """
    return _TOGETHER.sub(lambda statistic: statistic[0].replace(" ", "\u00a0"), text)


def heading_pieces(header: Sequence[str]) -> list[list[tuple[str, bool]]]:
    """The heads of a table's columns in pieces; True where one is the symbol of a statistic.

    A level may be called F or t: alone such a letter is a symbol only next to a p or degrees of freedom, and
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


def with_minus(text: str) -> str:
    """The text with a minus sign, no hyphen, before negative numbers; -3dB is a name."""
    return _MINUS.sub("−", text)


def signed_cell(cell: str, numeric: bool) -> str:
    """A table's cell with minus signs where it holds numbers alone, and in differences of labels.

    The hyphens of ids and labels stay.

    Examples
    --------
    >>> signed_cell("-0.31 (0.12)", True), signed_cell("id -7", True), signed_cell("-7", False)
    ('−0.31 (0.12)', 'id -7', '-7')
    >>> signed_cell("slow-in - fast", False)
    'slow-in − fast'
    """
    if not numeric:
        indent = len(cell) - len(cell.lstrip(" "))
        return "\u00a0" * indent + cell[indent:].replace(" - ", " − ")
    return cell if _LETTER.search(cell) else with_minus(cell)


def cell_pieces(cell: str, numeric: bool) -> list[tuple[str, bool]]:
    """A table's cell in pieces: in a column of numbers it may hold a statistic.

    Examples
    --------
    >>> cell_pieces("r = -.31", True), cell_pieces("F = 3", False)
    ([('r', True), (' = −.31', False)], [('F = 3', False)])
    """
    text = with_minus(cell) if numeric and _SYMBOL.search(cell) else signed_cell(cell, numeric)
    return _split(text, _SYMBOL) if numeric else [(text, False)]


def _split(text: str, symbols: re.Pattern[str]) -> list[tuple[str, bool]]:
    split, at = list[tuple[str, bool]](), 0
    for symbol in symbols.finditer(text):
        split += [(text[at : symbol.start()], False), (symbol[0], True)]
        at = symbol.end()
    return [piece for piece in (*split, (text[at:], False)) if piece[0]]
