"""How wide the columns of a table are where the page has a width: numbers whole, texts in what is left."""

from analysis.report.formats import Table

LINE_CHARACTERS = 100
"""Characters of a table's font in a line of LaTeX's page, some spared."""
GAP_CHARACTERS = 2
CM_A_CHARACTER, CM_BESIDE = 0.19, 0.48
"""Of Word's tables at 8 points: a character, bold ones too, and the space beside a cell's text."""
FEWEST_CM = 2.4


def text_share(table: Table) -> float:
    """The share of a line, .25 to .75, that the first column of a LaTeX table gets: what the others leave."""
    others = sum(size + GAP_CHARACTERS for size in _sizes(table)[1:])
    need = _sizes(table)[0]
    return min(max(min(LINE_CHARACTERS - others - GAP_CHARACTERS, need) / LINE_CHARACTERS, 0.25), 0.75)


def widths_cm(table: Table, room: float) -> list[float]:
    """Widths of the columns in cm, `room` together at most where texts can give way.

    Columns of numbers are as wide as their widest cell; those of text share what is left by their need.
    """
    needs = [size * CM_A_CHARACTER + CM_BESIDE for size in _sizes(table)]
    spare = room - sum(needs)
    if spare >= 0:
        return needs
    texts = needs[: table.text_columns]
    factor = (sum(texts) + spare) / sum(texts)
    return [*(max(width * factor, min(width, FEWEST_CM)) for width in texts), *needs[table.text_columns :]]


def _sizes(table: Table) -> list[int]:
    """Characters of the widest cell of each column."""
    return [max(map(len, column)) for column in zip(table.header, *table.rows, strict=True)]
