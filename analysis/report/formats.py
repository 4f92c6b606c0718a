"""A table, and its renderings as terminal text and Markdown (HTML is the report template's)."""

from collections.abc import Sequence
from dataclasses import dataclass

WIDTH = 80
_GAP = 2


@dataclass(frozen=True)
class Table:
    """A titled table of text cells. The first `text_columns` columns are left-aligned, the rest right."""

    key: str
    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    text_columns: int = 1
    notes: tuple[str, ...] = ()
    folded: bool = False
    """Whether the HTML report shows it folded: it is long, or for reference."""

    @property
    def note(self) -> str:
        """The notes as one paragraph; empty without any."""
        return " ".join(map(as_sentence, self.notes))


def as_sentence(text: str) -> str:
    """A line with a capital at its start, where it begins with a word, and a full stop at its end.

    Examples
    --------
    >>> as_sentence("rating p_1"), as_sentence("exp1 has none."), as_sentence("")
    ('Rating p_1.', 'exp1 has none.', '')
    """
    first = text.split(" ", 1)[0].rstrip(",:")
    is_word = len(first) > 1 and first.isalpha() and first.islower()
    said = text[:1].upper() + text[1:] if is_word else text
    return said if not said or said.endswith((".", "!", "?")) else f"{said}."


def as_text(table: Table, width: int = WIDTH) -> str:
    """Monospaced text, `width` columns wide where it can be broken; long first cells wrap, mostly at ':'.

    Numbers, and words of the title, the notes and the later columns, stay whole, though they be wider.
    """
    sizes = _column_widths(table, width)
    rule = "─" * min(width, sum(sizes) + _GAP * (len(sizes) - 1))
    lines = [*wrap(table.title, width), rule, *_text_row(table.header, sizes, table.text_columns), rule]
    for row in table.rows:
        lines += _text_row(row, sizes, table.text_columns)
    lines.append(rule)
    for note in table.notes:
        lines += wrap(note, width)
    return "\n".join(line.rstrip() for line in lines)


def _column_widths(table: Table, width: int) -> list[int]:
    """The first column gives way down to its longest word, then the widest that has a space."""
    columns = list(zip(table.header, *table.rows, strict=True))
    sizes = [max(map(len, column)) for column in columns]
    room = width - sum(sizes[1:]) - _GAP * (len(sizes) - 1)
    floors = [max((len(word) for cell in column for word in cell.split()), default=0) for column in columns]
    sizes[0] = min(sizes[0], max(room, 12, min(floors[0], 20)))
    spare = [size - floor - _GAP for size, floor in zip(sizes, floors, strict=True)]
    while sum(sizes) + _GAP * (len(sizes) - 1) > width and max(spare[1:], default=0) > 0:
        widest = max((i for i in range(1, len(sizes)) if spare[i] > 0), key=sizes.__getitem__)
        sizes[widest] -= 1
        spare[widest] -= 1
    if (over := sum(sizes) + _GAP * (len(sizes) - 1) - width) > 0:
        sizes[0] = min(sizes[0], max(12, sizes[0] - over))
    return sizes


def _text_row(row: Sequence[str], sizes: Sequence[int], text_columns: int) -> list[str]:
    cells = [_fold(cell, size) for cell, size in zip(row, sizes, strict=True)]
    lines = []
    for at in range(max(map(len, cells))):
        parts = [cell[at] if at < len(cell) else "" for cell in cells]
        lines.append(
            (" " * _GAP).join(
                part.ljust(size) if i < max(text_columns, 1) else part.rjust(size)
                for i, (part, size) in enumerate(zip(parts, sizes, strict=True))
            )
        )
    return lines


def _fold(text: str, width: int) -> list[str]:
    """Lines of at most `width`, later ones indented; a word that is longer is cut."""
    lines, indent = list[str](), ""
    while len(indent + text) > width:
        room = width - len(indent)
        cut = max(text.rfind(":", 0, room), text.rfind(" ", 0, room)) + 1 or room
        lines.append(indent + text[:cut].rstrip())
        text, indent = text[cut:].lstrip(), "  "
    return [*lines, indent + text]


def wrap(text: str, width: int = WIDTH, indent: str = "  ") -> list[str]:
    """Break a sentence at its spaces into lines of at most `width`, later ones indented.

    A longer word, such as a path that is to be copied, has a separate line.
    """
    lines, line = [], ""
    for word in text.split():
        if line and len(line) + 1 + len(word) > width:
            lines.append(line)
            line = indent + word
        else:
            line = f"{line} {word}" if line.strip() else line + word
    return [*lines, line]


def as_markdown(table: Table) -> str:
    """A GitHub-flavoured table with its title and notes."""
    align = [":--" if i < table.text_columns else "--:" for i in range(len(table.header))]
    rows = [table.header, tuple(align), *table.rows]
    body = "\n".join("| " + " | ".join(_markdown_cell(cell) for cell in row) + " |" for row in rows)
    notes = "\n".join(f"*{note}*  " for note in table.notes)
    return f"**{table.title}**\n\n{body}\n" + (f"\n{notes}\n" if notes else "")


def _markdown_cell(cell: str) -> str:
    # The backslash first, or it would escape those that are added after it.
    return cell.replace("\\", "\\\\").replace("|", "\\|").replace("<", "\\<")


# How wide the columns of a table are where the page has a width: numbers whole, texts in what is left.

LINE_CHARACTERS = 100
"""Characters of a table's font in a line of LaTeX's page, some spared."""
GAP_CHARACTERS = 2
CM_A_CHARACTER, CM_BESIDE = 0.17, 0.32
"""Widths in Word's tables at 9 points: a character, and the space around a cell's text."""
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
    columns = zip(table.header, *table.rows, strict=True)
    needs = [max(map(_print_width, column)) * CM_A_CHARACTER + CM_BESIDE for column in columns]
    spare = room - sum(needs)
    if spare >= 0:
        return needs
    texts = needs[: table.text_columns]
    factor = (sum(texts) + spare) / sum(texts)
    return [*(max(width * factor, min(width, FEWEST_CM)) for width in texts), *needs[table.text_columns :]]


def _print_width(text: str) -> float:
    """The characters of a text, in which capitals count more."""
    return len(text) + 0.4 * sum(one.isupper() for one in text)


def _sizes(table: Table) -> list[int]:
    """Characters of the widest cell of each column."""
    return [max(map(len, column)) for column in zip(table.header, *table.rows, strict=True)]
