"""Many small writes in one commit, and the statements of ratings and views compiled once."""

import asyncio
import threading
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar, cast

from sqlalchemy import Connection, Delete, Dialect, Insert, Select, Update
from sqlalchemy.exc import DBAPIError
from sqlalchemy.sql.compiler import SQLCompiler
from sqlalchemy.types import TypeEngine

from server.core.db import Database, Writer, is_busy, is_cut
from server.core.errors import ApiError

# Many small writes, one commit: what is acknowledged is on disk, which is asked once for all who wait.
#
# An endpoint hands its work to a writer thread and awaits it. The writer takes everything that waits, does
# it in one transaction and answers after the commit. SQLite has one writer; PostgreSQL has several, and
# work with the same key goes to the same one, so that two of them do not wait for each other's rows.
#
# Each transaction takes all light work that waits (a rating) and only little heavy work (a run start writes a
# hundred rows): a thousand people who start at once neither hold up those who rate nor are held up for ever.

T = TypeVar("T")
MAX_LIGHT = 64
"""Pieces of light work that share one commit."""
MAX_HEAVY = 16
"""Weight of the heavy work among them; a rating weighs 1. One piece goes in though it is heavier."""
KEPT_S = 1.0
"""How long a writer without work keeps its connection."""
POSTGRES_WRITERS = 4
"""Writers of light work; PostgreSQL has one more, for heavy work."""


@dataclass
class _Work:
    do: Callable[[Connection], Any]
    weight: int
    loop: asyncio.AbstractEventLoop
    future: "asyncio.Future[Any]"
    result: Any = None
    error: BaseException | None = None

    def attempt(self, connection: Connection) -> None:
        """Do it. A refusal is its answer; anything else ends the whole transaction.

        Work checks before it writes, so a refusal leaves nothing behind that must be undone.
        """
        # Cleared first: the same work may be tried a second time, alone or by a fresh connection.
        self.result, self.error = None, None
        try:
            self.result = self.do(connection)
        except ApiError as refusal:
            self.error = refusal

    def answer(self) -> None:
        """Hand over the outcome, in the event loop; nobody may be waiting any more."""
        # The future of a canceled request is done already, and a second result would raise.
        if self.future.done():
            return
        if self.error is not None:
            self.future.set_exception(self.error)
        else:
            self.future.set_result(self.result)


class _Queue:
    """What waits for one writer."""

    def __init__(self) -> None:
        self._light: deque[_Work] = deque()
        self._heavy: deque[_Work] = deque()
        self._ends = False
        self._changed = threading.Condition()

    def put(self, work: _Work) -> None:
        with self._changed:
            # Two queues: a rating overtakes the run starts that came before it.
            (self._heavy if work.weight > 1 else self._light).append(work)
            self._changed.notify()

    def end(self) -> None:
        """Nothing more will come."""
        with self._changed:
            self._ends = True
            self._changed.notify()

    def take(self, rest: Callable[[], None]) -> list[_Work]:
        """What shares the next commit, light work first; empty at the end. Waits; rests if that is long."""
        with self._changed:
            # Two waits: after the first the connection is given back, and the second holds nothing.
            if not self._changed.wait_for(self._has_news, KEPT_S):
                rest()
                self._changed.wait_for(self._has_news)
            batch = [self._light.popleft() for _ in range(min(MAX_LIGHT, len(self._light)))]
            weight = 0
            # The first piece goes in whatever it weighs: one above MAX_HEAVY would otherwise wait for ever.
            while self._heavy and (weight == 0 or weight + self._heavy[0].weight <= MAX_HEAVY):
                weight += self._heavy[0].weight
                batch.append(self._heavy.popleft())
            return batch

    def _has_news(self) -> bool:
        return bool(self._light or self._heavy or self._ends)


# Decision 0160: Ratings share a commit.
class GroupCommit:
    """The writers of one process; threads start with the first work."""

    def __init__(self, database: Database) -> None:
        self.database = database
        self._queues: list[_Queue] = []
        self._threads: list[threading.Thread] = []
        self._starting = threading.Lock()

    async def run(self, key: str, work: Callable[[Connection], T], weight: int = 1) -> T:
        """Do `work` in a transaction shared with others and return its result once that is committed.

        Parameters
        ----------
        weight : int, optional
            How many ratings it is worth; work heavier than one waits as the module says.
        """
        loop = asyncio.get_running_loop()
        future: asyncio.Future[T] = loop.create_future()
        queues = self._queues or self._start()
        # The last writer takes heavy work alone; with SQLite it is also the only one.
        queue = hash(key) % max(1, len(queues) - 1) if weight == 1 else -1
        queues[queue].put(_Work(work, weight, loop, future))
        return await future

    def close(self) -> None:
        """Finish what waits, then stop."""
        # All queues end before any thread is joined: the writers finish at the same time and not in turn.
        for queue in self._queues:
            queue.end()
        for thread in self._threads:
            thread.join()
        self._queues, self._threads = [], []

    def _start(self) -> list[_Queue]:
        with self._starting:
            # Checked again under the lock: two threads that come at once would each start their writers.
            if not self._queues:
                number = 1 if self.database.is_sqlite else POSTGRES_WRITERS + 1
                queues = [_Queue() for _ in range(number)]
                for queue in queues:
                    # A daemon, so that a process whose `close` is never called still ends.
                    thread = threading.Thread(target=self._write, args=(queue,), name="writer", daemon=True)
                    thread.start()
                    self._threads.append(thread)
                # Set last: `run` takes a list that is not empty as the sign that every writer has a thread.
                self._queues = queues
            return self._queues

    def _write(self, queue: _Queue) -> None:
        writer = self.database.writer()
        while batch := queue.take(writer.rest):
            _commit(writer, batch)
            # One call into each event loop per commit, since every such call wakes the loop through a pipe.
            for loop in {work.loop for work in batch}:
                mine = [work for work in batch if work.loop is loop]
                _resolve_batch(loop, mine)
        writer.rest()


def _commit(writer: Writer, batch: list[_Work]) -> None:
    was_kept = writer.is_kept
    try:
        with writer.transaction() as connection:
            for work in batch:
                work.attempt(connection)
    except Exception as error:
        if was_kept and is_cut(error):
            # It may have been cut long ago. All work can be done again: what is stored is stored once.
            _commit(writer, batch)
            return
        # A busy database refuses every piece alike: one by one they would wait in vain as many times.
        if len(batch) == 1 or is_busy(error):
            for work in batch:
                work.error = error
            return
        # One of them broke the transaction of all: each gets a separate one.
        for work in batch:
            _commit(writer, [work])


def _resolve_batch(loop: asyncio.AbstractEventLoop, batch: list[_Work]) -> None:
    def answer_all() -> None:
        for work in batch:
            work.answer()

    # At shutdown a loop may be closed before the last commit, and the call would raise.
    if not loop.is_closed():
        loop.call_soon_threadsafe(answer_all)


# Statements that run with every rating and view: compiled once, then run at the driver's own cursor.
#
# SQLAlchemy makes the text and knows the types, for either database. What else it repeats for each
# statement (looking for the compiled form, contexts, events, results by any name) takes several times as
# long as the database.

Row = TypeVar("Row", bound=tuple[Any, ...])
_Change = Callable[[Any], Any]
_ResultProcessors = tuple[tuple[int, _Change], ...]
"""Columns by number, each with the converter from the driver's value."""


class _Parameter(NamedTuple):
    """A parameter of a statement.

    Attributes
    ----------
    name : str
        Its name.
    change : callable or None
        Converts our value to the driver's; None if they are the same.
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
        Values that are part of the statement itself.
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
        # Two threads may compile it at once: their results are equal, so that no lock is needed.
        if dialect.name not in self._compiled:
            self._compiled[dialect.name] = _compile_statement(self._statement, dialect, self._columns)
        compiled = self._compiled[dialect.name]
        # The driver's own cursor is used below, so SQLAlchemy does not notice that a transaction has to
        # begin.
        if not connection.in_transaction():
            connection.begin()
        # Before the cursor: a value that is missing must not leave one open.
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
        self._processors: dict[str, _ResultProcessors] = {}

    def all(self, connection: Connection, values: Mapping[str, Any]) -> list[Row]:
        """Every row; raises as `run`."""
        dialect = connection.dialect
        cursor = self._cursor(connection, values)
        # Only a result names the driver's type codes, so that these cannot be made with the statement.
        if dialect.name not in self._processors:
            self._processors[dialect.name] = _result_processors(self._types, dialect, cursor.description)
        rows, processors = cursor.fetchall(), self._processors[dialect.name]
        cursor.close()
        if processors:
            rows = [_processed_row(row, processors) for row in rows]
        return list(map(self._make, rows))

    def one_or_none(self, connection: Connection, values: Mapping[str, Any]) -> Row | None:
        """The one row that there can be at most; raises as `run`."""
        rows = self.all(connection, values)
        return rows[0] if rows else None


def _compile_statement(statement: Any, dialect: Dialect, columns: list[str]) -> _Compiled:
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


def _result_processors(
    types: Sequence[TypeEngine[Any]], dialect: Dialect, described: Sequence[Any]
) -> _ResultProcessors:
    """The converters of the driver's values in these columns, as the driver describes them."""
    changes = [
        kind.dialect_impl(dialect).result_processor(dialect, column[1])
        for kind, column in zip(types, described, strict=True)
    ]
    return tuple((index, change) for index, change in enumerate(changes) if change is not None)


def _processed_row(row: Sequence[Any], processors: _ResultProcessors) -> list[Any]:
    values = list(row)
    for index, change in processors:
        values[index] = change(values[index])
    return values


def _as_sqlalchemy_raises(connection: Connection, text: str, error: Any) -> DBAPIError:
    """The driver's error as the rest of the program knows it; a broken connection is given up."""
    dialect = connection.dialect
    # A dead connection must not go back to the pool, which would hand it to the next who asks.
    is_cut = dialect.is_disconnect(error, connection.connection, None)
    if is_cut:
        connection.invalidate(error)
    made = DBAPIError.instance(
        text,
        None,
        error,
        dialect.loaded_dbapi.Error,
        # They are people's answers, and errors are logged.
        hide_parameters=True,
        connection_invalidated=is_cut,
        dialect=dialect,
    )
    return cast(DBAPIError, made)
