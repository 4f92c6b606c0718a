"""New values as TOML: a table of its own, or within a line where it is short."""

import json
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import tomlkit
from tomlkit.items import AoT, Array, InlineTable, Item, Table

MAX_INLINE = 120
"""Longest table, as JSON, that is written within a line."""
Closed = TypeVar("Closed")


def are_tables(value: Any) -> bool:
    """Whether a value is a list of tables."""
    return isinstance(value, list) and bool(value) and all(isinstance(item, Mapping) for item in value)


def is_inline(table: Any) -> bool:
    """Whether `table` is written within one line, so that what is put into it has to be."""
    return isinstance(table, InlineTable)


def item(value: Any, in_line: bool = False, top: bool = False) -> Item:
    """A new value as it is best read: a table of its own, or within a line where it is short."""
    if in_line:
        return inline_item(value)
    if isinstance(value, Mapping):
        return table(value) if top or not _is_short(value) else inline_item(value)
    if are_tables(value) and not _are_rows(value):
        tables = tomlkit.aot()
        for element in value:
            tables.append(table(element))
        return close(tables)
    return inline_item(value)


def table(value: Mapping[str, Any]) -> Table:
    """A table with a header of its own: short keys first, tables after them."""
    table = tomlkit.table()
    later = {key: inner for key, inner in value.items() if not isinstance(item(inner), Table | AoT)}
    for key, inner in later.items():
        table.append(key, item(inner))
    if later or not value:
        table.add(tomlkit.nl())
    for key, inner in value.items():
        if key not in later:
            table.append(key, item(inner))
    return close(table)


def close(item: Closed) -> Closed:
    """Without the blank lines that tomlkit puts above tables: here each table ends with one."""
    if isinstance(item, AoT):
        for table in item.body:
            close(table)
    elif isinstance(item, Table):
        item.trivia.indent = ""
        for _, inner in item.value.body:
            close(inner)
    return item


def _is_short(value: Any) -> bool:
    written = json.dumps(value, ensure_ascii=False)
    return len(written) <= MAX_INLINE and "\\n" not in written


def _are_rows(value: Sequence[Mapping[str, Any]]) -> bool:
    """Whether elements are as small as an option or a level: a line each."""
    return all(len(element) <= 3 and _is_short(element) for element in value)


def inline_item(value: Any) -> Item:
    """A value that stands behind its key; a list of tables takes a line an element."""
    if isinstance(value, Mapping):
        table = tomlkit.inline_table()
        for key, inner in value.items():
            table.append(key, inline_item(inner))
        return table
    if isinstance(value, list):
        array = tomlkit.array()
        for inner in value:
            array.append(inline_item(inner))
        spread_elements(array)
        return array
    if isinstance(value, str):
        return _text(value)
    item: Item = tomlkit.item(value)
    return item


def _text(value: str) -> Item:
    """Text of several lines begins below its quotes, as one writes it by hand."""
    if "\n" not in value:
        return tomlkit.string(value)
    written = tomlkit.string(value, multiline=True).as_string()
    # A line break right after the quotes does not count; tomlkit has put one where the text begins with one.
    below = written if value.startswith("\n") else f'"""\n{written[3:]}'
    return tomlkit.value(below)


def spread_elements(array: Array) -> None:
    """Give each element a line, where it is a table or the array is long."""
    array.multiline(any(isinstance(item, Mapping) for item in array) or len(array.as_string()) > MAX_INLINE)


def fresh_document(data: Mapping[str, Any]) -> tomlkit.TOMLDocument:
    """A whole text: short keys first, tables after them, a blank line between."""
    document = tomlkit.document()
    items = {key: item(value, top=True) for key, value in data.items()}
    for later in (False, True):
        for key, value in items.items():
            if isinstance(value, Table | AoT) is later:
                document.append(key, value)
        if not later:
            document.add(tomlkit.nl())
    for value in items.values():
        close(value)
    return document
