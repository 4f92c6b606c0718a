"""Many small writes, one commit: what is acknowledged is on disk, which is asked once for all who wait.

An endpoint hands its work to a writer thread and awaits it. The writer takes everything that waits, does it
in one transaction and answers after the commit. SQLite has one writer; PostgreSQL has several, and work with
the same key goes to the same one, so that two of them do not wait for each other's rows.
"""

import asyncio
import threading
from collections.abc import Callable
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

from sqlalchemy import Connection

from server.db import Database
from server.errors import ApiError

T = TypeVar("T")
MOST_AT_ONCE = 64
POSTGRES_WRITERS = 4


@dataclass
class _Work:
    do: Callable[[Connection], Any]
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


class GroupCommit:
    """The writers of one process; threads start with the first work."""

    def __init__(self, database: Database) -> None:
        self.database = database
        self._queues: list[SimpleQueue[_Work | None]] = []
        self._threads: list[threading.Thread] = []
        self._starting = threading.Lock()

    async def run(self, key: str, work: Callable[[Connection], T]) -> T:
        """Do `work` in a transaction shared with others and return its result once that is committed."""
        loop = asyncio.get_running_loop()
        future: asyncio.Future[T] = loop.create_future()
        queues = self._queues or self._start()
        queues[hash(key) % len(queues)].put(_Work(work, loop, future))
        return await future

    def close(self) -> None:
        """Finish what waits, then stop."""
        for queue in self._queues:
            queue.put(None)
        for thread in self._threads:
            thread.join()
        self._queues, self._threads = [], []

    def _start(self) -> "list[SimpleQueue[_Work | None]]":
        with self._starting:
            if not self._queues:
                count = 1 if self.database.is_sqlite else POSTGRES_WRITERS
                queues: list[SimpleQueue[_Work | None]] = [SimpleQueue() for _ in range(count)]
                for queue in queues:
                    thread = threading.Thread(target=self._write, args=(queue,), name="writer", daemon=True)
                    thread.start()
                    self._threads.append(thread)
                self._queues = queues
            return self._queues

    def _write(self, queue: "SimpleQueue[_Work | None]") -> None:
        while (first := queue.get()) is not None:
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


def _waiting(queue: "SimpleQueue[_Work | None]", first: _Work) -> tuple[list[_Work], bool]:
    """`first` and what waits behind it; True where the end was among it."""
    batch = [first]
    while len(batch) < MOST_AT_ONCE:
        try:
            work = queue.get_nowait()
        except Empty:
            return batch, False
        if work is None:
            return batch, True
        batch.append(work)
    return batch, False


def _tell(loop: asyncio.AbstractEventLoop, batch: list[_Work]) -> None:
    def answer_all() -> None:
        for work in batch:
            work.answer()

    if not loop.is_closed():
        loop.call_soon_threadsafe(answer_all)
