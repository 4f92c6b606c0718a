"""Statements that run with every rating and view: compiled once, then run at the driver's own cursor.

SQLAlchemy makes the text and knows the types, for either database. What else it does anew for each statement
(looking for the compiled form, contexts, events, results by any name) takes several times as long as the
database.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar, cast

from sqlalchemy import Connection, Delete, Dialect, Insert, Select, Update
from sqlalchemy.exc import DBAPIError
from sqlalchemy.sql.compiler import SQLCompiler
from sqlalchemy.types import TypeEngine

Row = TypeVar("Row", bound=tuple[Any, ...])
_Change = Callable[[Any], Any]
_WaysOut = tuple[tuple[int, _Change], ...]
"""Columns by their numbers, and what makes a value of that which the driver gives."""


class _Parameter(NamedTuple):
    """A parameter of a statement.

    Attributes
    ----------
    name : str
        Its name.
    change : callable or None
        Makes the driver's value of ours; None where it is the same.
    """

    name: str
    change: _Change | None


@dataclass(frozen=True)
class _Compiled:
    """A statement as one kind of database takes it.

    Attributes
    ----------
    text : str
        The statement.
    parameters : tuple of _Parameter
        In the order of the statement.
    constants : mapping
        Values that stand in the statement itself.
    is_positional : bool
        Whether the driver takes the values by their order.
    """

    text: str
    parameters: tuple[_Parameter, ...]
    constants: Mapping[str, Any]
    is_positional: bool

    def values(self, given: Mapping[str, Any]) -> Sequence[Any] | Mapping[str, Any]:
        """The parameters as the driver takes them; KeyError where one is missing."""
        every = {**self.constants, **given} if self.constants else given
        if self.is_positional:
            return [
                every[name] if change is None else change(every[name]) for name, change in self.parameters
            ]
        return {
            name: every[name] if change is None else change(every[name]) for name, change in self.parameters
        }


class Prepared:
    """A statement that gives no rows.

    Parameters
    ----------
    statement : Insert or Update or Delete or Select
        With its parameters as `bindparam`, or an insert.
    columns : iterable of str
        Of an insert, those that are given.
    """

    def __init__(
        self, statement: Insert | Update | Delete | Select[Any], columns: Iterable[str] = ()
    ) -> None:
        self._statement, self._columns = statement, list(columns)
        self._compiled: dict[str, _Compiled] = {}

    def run(self, connection: Connection, values: Mapping[str, Any]) -> None:
        """Run it in the connection's transaction, which begins where none has.

        Raises
        ------
        DBAPIError
            As SQLAlchemy would.
        KeyError
            A value is missing.
        """
        self._cursor(connection, values).close()

    def count(self, connection: Connection, values: Mapping[str, Any]) -> int:
        """Run a change, and return how many rows it changed; raises as `run`."""
        cursor = self._cursor(connection, values)
        changed = int(cursor.rowcount)
        cursor.close()
        return changed

    def _cursor(self, connection: Connection, values: Mapping[str, Any]) -> Any:
        """The driver's cursor on the rows that there are."""
        dialect = connection.dialect
        if dialect.name not in self._compiled:
            self._compiled[dialect.name] = _compiled(self._statement, dialect, self._columns)
        compiled = self._compiled[dialect.name]
        if not connection.in_transaction():
            connection.begin()
        given = compiled.values(values)
        try:
            cursor = connection.connection.cursor()
            cursor.execute(compiled.text, given)
        except dialect.loaded_dbapi.Error as error:
            raise _as_sqlalchemy_raises(connection, compiled.text, error) from error
        return cursor


class Query(Prepared, Generic[Row]):
    """A statement that gives rows; `make` makes each of its columns in order, as a named tuple's `_make`."""

    def __init__(self, statement: Select[Any], make: Callable[[Iterable[Any]], Row]) -> None:
        super().__init__(statement)
        self._types = [column.type for column in statement.selected_columns]
        self._make = make
        self._ways_out: dict[str, _WaysOut] = {}

    def all(self, connection: Connection, values: Mapping[str, Any]) -> list[Row]:
        """Every row; raises as `run`."""
        dialect = connection.dialect
        cursor = self._cursor(connection, values)
        if dialect.name not in self._ways_out:
            self._ways_out[dialect.name] = _ways_out(self._types, dialect, cursor.description)
        rows, ways_out = cursor.fetchall(), self._ways_out[dialect.name]
        cursor.close()
        if ways_out:
            rows = [_changed(row, ways_out) for row in rows]
        return list(map(self._make, rows))

    def one_or_none(self, connection: Connection, values: Mapping[str, Any]) -> Row | None:
        """The one row that there can be at most; raises as `run`."""
        rows = self.all(connection, values)
        return rows[0] if rows else None


def _compiled(statement: Any, dialect: Dialect, columns: list[str]) -> _Compiled:
    compiled: SQLCompiler = statement.compile(dialect=dialect, column_keys=columns or None)
    names = (compiled.positiontup or ()) if compiled.positional else tuple(compiled.binds)
    binds = {name: compiled.binds[name] for name in names}
    changes = {name: bind.type.dialect_impl(dialect).bind_processor(dialect) for name, bind in binds.items()}
    return _Compiled(
        compiled.string,
        tuple(_Parameter(name, changes[name]) for name in names),
        {name: bind.effective_value for name, bind in binds.items() if not bind.required},
        compiled.positional,
    )


def _ways_out(types: Sequence[TypeEngine[Any]], dialect: Dialect, described: Sequence[Any]) -> _WaysOut:
    """What is to be changed of what the driver gives in these columns, which it has described."""
    changes = [
        kind.dialect_impl(dialect).result_processor(dialect, column[1])
        for kind, column in zip(types, described, strict=True)
    ]
    return tuple((index, change) for index, change in enumerate(changes) if change is not None)


def _changed(row: Sequence[Any], ways_out: _WaysOut) -> list[Any]:
    values = list(row)
    for index, change in ways_out:
        values[index] = change(values[index])
    return values


def _as_sqlalchemy_raises(connection: Connection, text: str, error: Any) -> DBAPIError:
    """The driver's error as the rest of the program knows it; a broken connection is given up."""
    dialect = connection.dialect
    is_cut = dialect.is_disconnect(error, connection.connection, None)
    if is_cut:
        connection.invalidate(error)
    made = DBAPIError.instance(
        text,
        None,
        error,
        dialect.loaded_dbapi.Error,
        hide_parameters=True,
        connection_invalidated=is_cut,
        dialect=dialect,
    )
    return cast(DBAPIError, made)
