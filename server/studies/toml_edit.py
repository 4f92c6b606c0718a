"""Write changed data into a TOML text: what did not change keeps its form, its order and its comments.

tomlkit counts a comment above `[[forms]]` to the table before it. Where elements are moved or removed, such
comments go with the element below them.
"""

import json
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import tomlkit
from tomlkit.container import Container
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import AoT, Array, Comment, InlineTable, Item, Table, Whitespace

from experiments.errors import InputError
from experiments.load import MAX_DEPTH, DefinitionError, is_deeper, sum_of_cubes, toml_data

# New values as TOML: a separate table, or within a line if it is short.

MAX_INLINE = 120
"""Longest table, as JSON, that is written within a line."""
Closed = TypeVar("Closed")


def are_tables(value: Any) -> bool:
    """Whether a value is a list of tables."""
    return isinstance(value, list) and bool(value) and all(isinstance(item, Mapping) for item in value)


def is_inline(table: Any) -> bool:
    """Whether `table` is written within one line, so that what is put into it has to be."""
    return isinstance(table, InlineTable)


def fresh_item(value: Any, in_line: bool = False, top: bool = False) -> Item:
    """A new value as it is best read: a separate table, or within a line if it is short."""
    if in_line:
        return inline_item(value)
    if isinstance(value, Mapping):
        return fresh_table(value) if top or not _is_short(value) else inline_item(value)
    if are_tables(value) and not _are_rows(value):
        tables = tomlkit.aot()
        for element in value:
            tables.append(fresh_table(element))
        return close(tables)
    return inline_item(value)


def fresh_table(value: Mapping[str, Any]) -> Table:
    """A table with its own header: short keys first, tables after them."""
    table = tomlkit.table()
    later = {key: inner for key, inner in value.items() if not isinstance(fresh_item(inner), Table | AoT)}
    for key, inner in later.items():
        table.append(key, fresh_item(inner))
    if later or not value:
        table.add(tomlkit.nl())
    for key, inner in value.items():
        if key not in later:
            table.append(key, fresh_item(inner))
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
    """A value after its key; a list of tables takes a line an element."""
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
    """Give each element its own line, where it is a table or the array is long."""
    array.multiline(any(isinstance(item, Mapping) for item in array) or len(array.as_string()) > MAX_INLINE)


def fresh_document(data: Mapping[str, Any]) -> tomlkit.TOMLDocument:
    """A whole text: short keys first, tables after them, a blank line between."""
    document = tomlkit.document()
    items = {key: fresh_item(value, top=True) for key, value in data.items()}
    for later in (False, True):
        for key, value in items.items():
            if isinstance(value, Table | AoT) is later:
                document.append(key, value)
        if not later:
            document.add(tomlkit.nl())
    for value in items.values():
        close(value)
    return document


# Write changed data into a TOML text: what did not change keeps its form, its order and its comments.

TOO_DEEP = "lists or tables are nested too deeply; correct the text first"
IDENTITY = ("name", "value", "rule", "kind")
"""Keys by which an element of a list is known again after an edit; else its content, then its place."""
MAX_ELEMENTS = 2000
"""Elements of lists in a text that is edited: each is compared with each, while others wait."""
MAX_LINES = 20_000
"""Most lines of an edited text: tomlkit makes an object of each line, empty ones too."""
MAX_CUBES = 40_000
"""Greatest sum of cubes of the parts of dotted keys: 1,500 keys of three parts take tomlkit some seconds."""


# Decision 0550: The builder edits data; the server writes the TOML.
def with_data(text: str, data: Mapping[str, Any]) -> str:
    """`text` with as few changes as make it say `data`; None values are left out.

    Raises
    ------
    InputError
        Where `text` is not TOML, `data` holds what TOML cannot say, or there is too much of either.
    """
    if is_deeper(data, MAX_DEPTH):
        raise InputError(TOO_DEEP)
    if text.count("\n") > MAX_LINES:
        raise InputError(f"expected at most {MAX_LINES} lines; edit such a text manually")
    edited = _without_none(data)
    _refuse_too_many(_said_by(text), edited)
    if sum_of_cubes(text) > MAX_CUBES:
        raise InputError("too many dotted keys of many parts; edit such a text manually")
    try:
        document = tomlkit.parse(text)
        _merge(document, edited)
        merged = tomlkit.dumps(document)
        if _is_same(tomllib.loads(merged), edited):
            return merged
    except (TOMLKitError, tomllib.TOMLDecodeError):
        pass
    except (TypeError, ValueError) as error:
        raise InputError(f"the declaration contains a value that TOML cannot represent: {error}") from error
    except RecursionError as error:
        raise InputError(TOO_DEEP) from error
    # Tables written out of order are beyond tomlkit's editing: the whole is then written afresh.
    return tomlkit.dumps(fresh_document(edited))


def _refuse_too_many(*said: Any) -> None:
    elements = max(map(_elements, said))
    if elements > MAX_ELEMENTS:
        raise InputError(
            f"expected at most {MAX_ELEMENTS} elements in all lists together, got {elements}; "
            "edit such a text manually"
        )


def _elements(value: Any) -> int:
    inner = list(value.values()) if isinstance(value, Mapping) else value if isinstance(value, list) else []
    return len(inner) * isinstance(value, list) + sum(map(_elements, inner))


def _said_by(text: str) -> dict[str, Any]:
    try:
        return toml_data(text)
    except DefinitionError as error:
        raise InputError(f"{error.problems[0]}; correct the text first") from error


def _without_none(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _without_none(inner) for key, inner in value.items() if inner is not None}
    if isinstance(value, list | tuple):
        return [_without_none(inner) for inner in value if inner is not None]
    return value


def _is_same(one: Any, other: Any) -> bool:
    """Equal, where true is not 1, and 60 is 60.0, as in JSON. Order of keys counts for nothing."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(_is_same(one[key], other[key]) for key in one)
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(_is_same, one, other))
    if isinstance(one, int | float) and isinstance(other, int | float):
        return isinstance(one, bool) is isinstance(other, bool) and one == other
    return type(one) is type(other) and bool(one == other)


def _plain_value(item: Any) -> Any:
    return item.unwrap() if hasattr(item, "unwrap") else item


def _merge(table: Any, edited: Mapping[str, Any]) -> None:
    for key in [key for key in table if key not in edited]:
        _remove(table, key)
    for key, value in edited.items():
        if key not in table:
            _add(table, key, value)
        elif not _is_same(_plain_value(table[key]), value):
            _change(table, key, value)


def _add(table: Any, key: str, value: Any) -> None:
    top = isinstance(table, tomlkit.TOMLDocument)
    item = fresh_item(value, is_inline(table), top)
    table[key] = item
    close(item)
    if top and isinstance(item, Table):
        item.trivia.indent = "\n"


def _remove(table: Any, key: str) -> None:
    """Remove a key; comments at the end of a table belong to what follows and are kept where that is."""
    item, container = table[key], table if isinstance(table, Container) else getattr(table, "value", None)
    kept = _take_tail(item) if isinstance(item, Table | AoT) else []
    before = _item_before(container, key) if kept and isinstance(container, Container) else None
    del table[key]
    if before is not None:
        _give_tail(before, kept)


def _item_before(container: Container, key: str) -> Any:
    previous = None
    for known, item in container.body:
        if known is not None and known.key == key:
            return previous
        if isinstance(item, Table | AoT):
            previous = item
    return None


def _change(table: Any, key: str, value: Any) -> None:
    old = table[key]
    if isinstance(value, Mapping) and isinstance(old, Mapping):
        _merge(old, value)
    elif isinstance(old, AoT) and are_tables(value):
        tables, lead = _merged_tables(old, value)
        container = table if isinstance(table, Container) else getattr(table, "value", None)
        before = _item_before(container, key) if isinstance(container, Container) else None
        table[key] = tables
        _give_tail(tables if before is None else before, lead)
    elif isinstance(old, Array) and isinstance(value, list):
        _merge_array(old, value)
    else:
        table[key] = fresh_item(value, is_inline(table))


def _known_again(old: Sequence[Any], edited: Sequence[Any]) -> list[int | None]:
    """For each wanted element the number of the old one that it is an edit of; None for new ones."""
    free = list(range(len(old)))
    known: list[int | None] = [None] * len(edited)

    def match(fits: Callable[[int, int], bool]) -> None:
        for index in range(len(edited)):
            number = next((number for number in free if fits(number, index)), None)
            if known[index] is None and number is not None:
                known[index] = number
                free.remove(number)

    match(lambda number, index: _is_same(old[number], edited[index]))
    match(lambda number, index: _are_of_one_name(old[number], edited[index]))
    if len(old) == len(edited):
        match(lambda number, index: number == index)
    return known


def _are_of_one_name(one: Any, other: Any) -> bool:
    return _identity(one) is not None and _identity(one) == _identity(other)


def _identity(element: Any) -> str | None:
    if not isinstance(element, Mapping):
        return None
    return next((f"{key}={element[key]}" for key in IDENTITY if key in element), None)


def _merged_tables(old: AoT, edited: Sequence[Mapping[str, Any]]) -> tuple[AoT, list[Any]]:
    """The elements in their new order, and the comments that are now above the first."""
    tables = list(old.body)
    above = [[], *[_take_tail(table) for table in tables]]
    known = _known_again([_plain_value(table) for table in tables], edited)
    fresh = tomlkit.aot()
    leads: list[list[Any]] = []
    for number, value in zip(known, edited, strict=True):
        if number is None:
            table, lead = fresh_table(value), []
            _take_tail(table)
        else:
            table, lead = tables[number], above[number]
            _merge(table, value)
        leads.append(lead)
        fresh.append(table)
    body = list(fresh.body)
    for table, lead in zip(body, [*leads[1:], above[-1]], strict=True):
        _give_tail(table, lead or [Whitespace("\n")])
    return close(fresh), leads[0]


def _last_container(item: Any) -> Container | None:
    """The container at the end of the lines that an item is written in."""
    while True:
        if isinstance(item, AoT):
            if not item.body:
                return None
            item = item.body[-1]
        if not isinstance(item, Table):
            return None
        container = item.value
        last = next(
            (one for _, one in reversed(container.body) if not isinstance(one, Whitespace | Comment)), None
        )
        if not isinstance(last, Table | AoT) or (isinstance(last, Table) and not last.value.body):
            return container
        item = last


def _take_tail(item: Any) -> list[Any]:
    """Cut off the comments and blank lines at the end of a table."""
    container = _last_container(item)
    tail: list[Any] = []
    while (
        container is not None and container.body and isinstance(container.body[-1][1], Whitespace | Comment)
    ):
        tail.insert(0, container.body.pop()[1])
    return tail


def _give_tail(item: Any, tail: Sequence[Any]) -> None:
    container = _last_container(item)
    if container is not None:
        container.body.extend((None, piece) for piece in tail)


def _merge_array(array: Array, edited: list[Any]) -> None:
    """Change an array in its place, so that its lines and their comments stay."""
    known = _known_again(_plain_value(array), edited)
    kept = [number for number in known if number is not None]
    if kept != sorted(kept) or not kept:
        array.clear()
        for value in edited:
            array.append(inline_item(value))
        spread_elements(array)
        return
    for number in reversed(range(len(array))):
        if number not in kept:
            del array[number]
    for index, (origin, value) in enumerate(zip(known, edited, strict=True)):
        if origin is None:
            array.insert(index, inline_item(value))
        elif not _is_same(_plain_value(array[index]), value):
            array[index] = inline_item(value)


# Comments, to see which of two texts has any that the other lacks.

_STRING_OR_COMMENT = re.compile(
    r'"""(?:\\.|[^\\])*?"""|\'\'\'.*?\'\'\'|"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'|(#[^\n]*)', re.DOTALL
)
"""Strings are skipped: their # begins no comment. Unlike tomlkit it takes long texts in linear time."""


def comments_of(text: str) -> list[str]:
    """The comments of a valid TOML text, from top to bottom.

    Examples
    --------
    >>> comments_of('# a study\\nname = "x" # short\\ntitle = "# no comment"')
    ['# a study', '# short']
    """
    return [comment.rstrip() for comment in _STRING_OR_COMMENT.findall(text) if comment]
