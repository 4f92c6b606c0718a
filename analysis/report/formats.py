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


def as_text(table: Table, width: int = WIDTH) -> str:
    """Monospaced text at most `width` columns wide; long first cells wrap, mostly at ':'."""
    rest = [max(len(row[i]) for row in (table.header, *table.rows)) for i in range(1, len(table.header))]
    room = width - sum(rest) - _GAP * len(rest)
    first = min(max(len(row[0]) for row in (table.header, *table.rows)), max(room, 12))
    rule = "─" * min(width, first + sum(rest) + _GAP * len(rest))
    lines = [table.title, rule, *_text_row(table.header, first, rest, table.text_columns), rule]
    for row in table.rows:
        lines += _text_row(row, first, rest, table.text_columns)
    lines.append(rule)
    for note in table.notes:
        lines += wrap(note, width)
    return "\n".join(line.rstrip() for line in lines)


def _text_row(row: Sequence[str], first: int, rest: list[int], text_columns: int) -> list[str]:
    wrapped = _fold(row[0], first)
    cells = [
        cell.ljust(size) if i < text_columns else cell.rjust(size)
        for i, (cell, size) in enumerate(zip(row[1:], rest, strict=True), start=1)
    ]
    lines = [part.ljust(first) for part in wrapped]
    lines[0] = (" " * _GAP).join([lines[0], *cells])
    return lines


def _fold(text: str, width: int) -> list[str]:
    lines: list[str] = []
    while len(text) > width:
        cut = max(text.rfind(":", 0, width), text.rfind(" ", 0, width)) + 1 or width
        lines.append(text[:cut].rstrip())
        text = "  " + text[cut:].lstrip()
    return [*lines, text]


def wrap(text: str, width: int = WIDTH, indent: str = "  ") -> list[str]:
    """Break a sentence into lines of at most `width`, later lines indented."""
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
    return cell.replace("\\", "\\\\").replace("|", "\\|").replace("<", "\\<")
