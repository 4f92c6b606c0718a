"""Many small writes, one commit: what is acknowledged is on disk, which is asked once for all who wait.

An endpoint hands its work to a writer thread and awaits it. The writer takes everything that waits, does it
in one transaction and answers after the commit. SQLite has one writer; PostgreSQL has several, and work with
the same key goes to the same one, so that two of them do not wait for each other's rows.

Each transaction takes all light work that waits (a rating) and only little heavy work (a run start writes a
hundred rows): a thousand people who start at once neither hold up those who rate nor are held up for ever.
"""

import asyncio
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

from sqlalchemy import Connection

from server.db import Database, Writer, is_busy, is_cut
from server.errors import ApiError

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
        self.result, self.error = None, None
        try:
            self.result = self.do(connection)
        except ApiError as refusal:
            self.error = refusal

    def answer(self) -> None:
        """Hand over the outcome, in the event loop; nobody may be waiting any more."""
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
            if not self._changed.wait_for(self._has_news, KEPT_S):
                rest()
                self._changed.wait_for(self._has_news)
            batch = [self._light.popleft() for _ in range(min(MAX_LIGHT, len(self._light)))]
            weight = 0
            while self._heavy and (weight == 0 or weight + self._heavy[0].weight <= MAX_HEAVY):
                weight += self._heavy[0].weight
                batch.append(self._heavy.popleft())
            return batch

    def _has_news(self) -> bool:
        return bool(self._light or self._heavy or self._ends)


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
        queue = hash(key) % max(1, len(queues) - 1) if weight == 1 else -1
        queues[queue].put(_Work(work, weight, loop, future))
        return await future

    def close(self) -> None:
        """Finish what waits, then stop."""
        for queue in self._queues:
            queue.end()
        for thread in self._threads:
            thread.join()
        self._queues, self._threads = [], []

    def _start(self) -> list[_Queue]:
        with self._starting:
            if not self._queues:
                number = 1 if self.database.is_sqlite else POSTGRES_WRITERS + 1
                queues = [_Queue() for _ in range(number)]
                for queue in queues:
                    thread = threading.Thread(target=self._write, args=(queue,), name="writer", daemon=True)
                    thread.start()
                    self._threads.append(thread)
                self._queues = queues
            return self._queues

    def _write(self, queue: _Queue) -> None:
        writer = self.database.writer()
        while batch := queue.take(writer.rest):
            _commit(writer, batch)
            for loop in {work.loop for work in batch}:
                mine = [work for work in batch if work.loop is loop]
                _tell(loop, mine)
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
        if len(batch) == 1 or is_busy(error):
            for work in batch:
                work.error = error
            return
        # One of them broke the transaction of all: each gets one of its own.
        for work in batch:
            _commit(writer, [work])


def _tell(loop: asyncio.AbstractEventLoop, batch: list[_Work]) -> None:
    def answer_all() -> None:
        for work in batch:
            work.answer()

    if not loop.is_closed():
        loop.call_soon_threadsafe(answer_all)
