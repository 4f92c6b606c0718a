"""A column of the exports: its name, type, unit, meaning, range, and source in the database."""

import re
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

JOINED = "{joined}"
"""Placeholder in a source for the function that joins texts; its name depends on the database."""
ColumnType = Literal["text", "integer", "number", "boolean", "time"]
"""A `number` read from JSON keeps its notation: 4 is exported as 4 and not as 4.0."""


@dataclass(frozen=True)
class Column:
    """A column of a view and its export; `description` is its line in the codebook.

    Attributes
    ----------
    unit : str or None
        The SI symbol, or the thing counted; None without a unit.
    values : tuple of str
        All possible values, for columns of names.
    labels : tuple of (str, str)
        Meanings of values, as pairs of value (as in the CSV) and label; not every value needs one.
    identifying : bool
        Whether it might identify a person: their own words, or data specific to their device.
    minimum, maximum : float or None
        The range of numbers, ends included; None where open.
    source : str
        The SQL behind it. An alias of the view's tables stands for `alias.name`; empty for columns without a
        view. `JOINED` in it is replaced by the function of the database.
    json : bool
        True where the source is a JSON column, exported as text.
    member : str
        Path of the value in the JSON object of the source (`choice`, `left.frames_drawn`); empty if the
        source is the value.
    otherwise : str
        SQL of the value used if there is none; empty for NULL.
    """

    name: str
    type: ColumnType
    description: str
    unit: str | None = None
    values: tuple[str, ...] = ()
    minimum: float | None = None
    maximum: float | None = None
    source: str = ""
    json: bool = False
    member: str = ""
    otherwise: str = ""
    labels: tuple[tuple[str, str], ...] = ()
    identifying: bool = False

    @property
    def expression(self) -> str:
        """The SQL behind the column, including the alias of its table."""
        return f"{self.source}.{self.name}" if self.source.isidentifier() else self.source

    @property
    def allowed(self) -> str:
        """The values or range of the column in words, with labels; empty if any value is allowed."""
        labels = dict(self.labels)
        if self.values:
            return ", ".join(f"{one} = {labels[one]}" if one in labels else one for one in self.values)
        range_, said = self._range, ", ".join(f"{value} = {label}" for value, label in self.labels)
        return f"{range_} ({said})" if range_ and said else range_ or said

    @property
    def _range(self) -> str:
        if self.minimum is not None and self.maximum is not None:
            return f"{self.minimum:g} to {self.maximum:g}"
        return f"{self.minimum:g} or more" if self.minimum is not None else ""

    def admits(self, value: object) -> bool:
        """True if `value` lies in the column's range or is one of its values; always true for None."""
        if value is None or (self.values and value == ""):
            return True
        if self.values:
            return value in self.values
        if not isinstance(value, int | float):
            return True
        low = self.minimum is None or value >= self.minimum
        return low and (self.maximum is None or value <= self.maximum)


def names_of(columns: Iterable[Column], *types: ColumnType) -> tuple[str, ...]:
    """Names of the columns of these types, in order; of all columns if no type is given."""
    return tuple(column.name for column in columns if not types or column.type in types)


# Names of columns made from names of levels, options and questions, which may be in any script.


def plain_name(text: str) -> str:
    """Letters, digits and underscores of `text`, without accents; `x` and code points if there are none.

    >>> plain_name("fast & near"), plain_name("Größe"), plain_name("-1.5"), plain_name("速")
    ('fast_near', 'Grosse', 'minus1_5', 'x901f')
    """
    signed = re.sub(r"^[-−](?=[\d.])", "minus", text.strip()).replace("ß", "ss")
    folded = unicodedata.normalize("NFKD", signed).encode("ascii", "ignore").decode()
    plain = re.sub(r"[^A-Za-z0-9]+", "_", folded).strip("_")
    return plain or "x" + "_".join(f"{ord(letter):x}" for letter in text[:8])


def unlike(name: str, taken: set[str]) -> str:
    """`name`, with a number appended if it is already taken (case-insensitive); it is then taken."""
    free, number = name, 2
    while free.casefold() in taken:
        free, number = f"{name}_{number}", number + 1
    taken.add(free.casefold())
    return free
