"""Many small writes, one commit: what is acknowledged is on disk, which is asked once for all who wait.

An endpoint hands its work to a writer thread and awaits it. The writer takes everything that waits, does it
in one transaction and answers after the commit. SQLite has one writer; PostgreSQL has several, and work with
the same key goes to the same one, so that two of them do not wait for each other's rows.

Heavy work (a run start writes a hundred rows) waits while lighter work comes, but not for long, and few of it
share a commit: a thousand people who start at once do not hold up those who rate.
"""

import asyncio
import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from queue import Empty, PriorityQueue
from typing import Any, TypeVar

from sqlalchemy import Connection

from server.db import Database
from server.errors import ApiError

T = TypeVar("T")
MOST_AT_ONCE = 64
"""Weight of what shares one commit; a rating weighs 1."""
POSTGRES_WRITERS = 4
"""Writers of light work; PostgreSQL has one more, for heavy work."""
PATIENCE_S = 0.25
"""Heavy work lets pass what is lighter and came no later than this after it."""


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


Queue = PriorityQueue[tuple[float, int, _Work | None]]
"""When it is due, in seconds; a number that settles ties; the work, or None at the very end."""


class GroupCommit:
    """The writers of one process; threads start with the first work."""

    def __init__(self, database: Database) -> None:
        self.database = database
        self._queues: list[Queue] = []
        self._threads: list[threading.Thread] = []
        self._starting = threading.Lock()
        self._numbers = count()

    async def run(self, key: str, work: Callable[[Connection], T], weight: int = 1) -> T:
        """Do `work` in a transaction shared with others and return its result once that is committed.

        weight: how many ratings it is worth; work heavier than one waits as the module says.
        """
        loop = asyncio.get_running_loop()
        future: asyncio.Future[T] = loop.create_future()
        queues = self._queues or self._start()
        due, place = time.monotonic(), hash(key) % max(1, len(queues) - 1)
        if weight > 1:
            due, place = due + PATIENCE_S, -1
        queues[place].put((due, next(self._numbers), _Work(work, weight, loop, future)))
        return await future

    def close(self) -> None:
        """Finish what waits, then stop."""
        for queue in self._queues:
            queue.put((math.inf, next(self._numbers), None))
        for thread in self._threads:
            thread.join()
        self._queues, self._threads = [], []

    def _start(self) -> list[Queue]:
        with self._starting:
            if not self._queues:
                number = 1 if self.database.is_sqlite else POSTGRES_WRITERS + 1
                queues: list[Queue] = [PriorityQueue() for _ in range(number)]
                for queue in queues:
                    thread = threading.Thread(target=self._write, args=(queue,), name="writer", daemon=True)
                    thread.start()
                    self._threads.append(thread)
                self._queues = queues
            return self._queues

    def _write(self, queue: Queue) -> None:
        while (first := queue.get()[2]) is not None:
            batch, ends = _waiting(queue, first)
            self._commit(batch)
            for loop in {work.loop for work in batch}:
                mine = [work for work in batch if work.loop is loop]
                _tell(loop, mine)
            if ends:
                return

    def _commit(self, batch: list[_Work]) -> None:
        try:
            with self.database.write_connection() as connection:
                for work in batch:
                    work.attempt(connection)
        except Exception as error:
            if len(batch) == 1:
                batch[0].error = error
                return
            # One of them broke the transaction of all: each gets one of its own.
            for work in batch:
                self._commit([work])


def _waiting(queue: Queue, first: _Work) -> tuple[list[_Work], bool]:
    """`first` and what waits behind it, up to the weight of a batch; True where the end was among it."""
    batch, weight = [first], first.weight
    while weight < MOST_AT_ONCE:
        try:
            work = queue.get_nowait()[2]
        except Empty:
            return batch, False
        if work is None:
            return batch, True
        batch.append(work)
        weight += work.weight
    return batch, False


def _tell(loop: asyncio.AbstractEventLoop, batch: list[_Work]) -> None:
    def answer_all() -> None:
        for work in batch:
            work.answer()

    if not loop.is_closed():
        loop.call_soon_threadsafe(answer_all)
