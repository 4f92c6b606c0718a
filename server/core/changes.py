"""Whether anything was written since, whether the server is to end, and work it looks for by itself."""

import asyncio
import logging
import signal
import threading
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from contextlib import asynccontextmanager, suppress
from types import FrameType
from typing import Any

from sqlalchemy import text
from sqlalchemy.exc import SQLAlchemyError
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.core.db import Database, kept_alive

# NOTIFY and LISTEN, by which the processes on one PostgreSQL notify one another that they wrote.

_CHANNEL = "palpebra_changes"


def say_changed(database: Database) -> None:
    """Notify every process that listens, including this one."""
    with database.engine.connect() as connection:
        connection.execute(text(f"NOTIFY {_CHANNEL}"))
        connection.commit()


def heard_changes(database: Database, look_s: float) -> Iterator[int]:
    """How many notifications came since the last time, every `look_s`, once it listens: 0 at first.

    Where the connection is cut, or there is none, psycopg's error is raised.
    """
    import psycopg  # only where the database is PostgreSQL

    address = kept_alive(database.url).set(drivername="postgresql")
    url = address.render_as_string(hide_password=False)
    with psycopg.connect(url, autocommit=True) as connection:
        connection.execute(f"LISTEN {_CHANNEL}")
        yield 0
        while True:
            yield sum(1 for _ in connection.notifies(timeout=look_s))


# Whether anything was written since: announced between processes by PostgreSQL's LISTEN and NOTIFY.
#
# A process that has written says so twice a second at most, on a separate connection after its commit: a
# NOTIFY within the transaction of a rating would have all commits of the database wait for one another.
# Streams so look at their study when there may be something to see, and hardly ever when there is not.

LOG = logging.getLogger(__name__)
EVERY_S = 0.5
"""So often a process says at most that it wrote."""
AGAIN_S = 2.0
LOOK_S = 0.5
"""How soon the listening thread notices that the server ends."""
READING = frozenset(("GET", "HEAD", "OPTIONS"))


class Changes:
    """The changes of all processes on one database, as this one hears of them; nothing on SQLite."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._wrote, self._ends = threading.Event(), threading.Event()
        self._starting = threading.Lock()
        self._threads: dict[str, threading.Thread] = {}
        self._number = 0
        self._listens = False

    @property
    def number(self) -> int | None:
        """Another one after each change; None where changes are not heard of, and one has to look."""
        if self._database.is_sqlite:
            return None
        self._start("changes-heard", self._listen)
        return self._number if self._listens else None

    def tell(self) -> None:
        """Say that this process has written; soon, and once for all that it wrote until then."""
        if not self._database.is_sqlite:
            self._wrote.set()
            self._start("changes-told", self._say)

    def close(self) -> None:
        """End the threads."""
        self._ends.set()
        self._wrote.set()
        for thread in self._threads.values():
            thread.join(AGAIN_S)

    def _start(self, name: str, work: Callable[[], None]) -> None:
        with self._starting:
            if name not in self._threads and not self._ends.is_set():
                self._threads[name] = threading.Thread(target=work, name=name, daemon=True)
                self._threads[name].start()

    def _say(self) -> None:
        while not self._ends.is_set():
            self._wrote.wait()
            self._wrote.clear()
            try:
                say_changed(self._database)
            except SQLAlchemyError as error:
                LOG.warning("a change could not be announced: %s", type(error).__name__)
            self._ends.wait(EVERY_S)

    def _listen(self) -> None:
        import psycopg

        while not self._ends.is_set():
            try:
                for number in heard_changes(self._database, LOOK_S):
                    # At first one more all the same: for what was missed meanwhile.
                    self._number += number if self._listens else 1
                    self._listens = True
                    if self._ends.is_set():
                        return
            except psycopg.Error as error:
                LOG.warning("changes are not heard of: %s", type(error).__name__)
            finally:
                self._listens = False
            self._ends.wait(AGAIN_S)


class ChangeNotifier:
    """Plain ASGI: whatever was asked for by a method that writes, and was not refused, may have written."""

    def __init__(self, app: ASGIApp, changes: Changes) -> None:
        self.app, self._changes = app, changes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http" or scope["method"] in READING:
            await self.app(scope, receive, send)
            return

        async def send_and_tell(message: Message) -> None:
            await send(message)
            if message["type"] == "http.response.start" and message["status"] < 400:
                self._changes.tell()

        await self.app(scope, receive, send_and_tell)


# Whether this server was asked to end: answers that last for hours check it, and do not delay the end.

SIGNALS = (signal.SIGTERM, signal.SIGINT)


class Stopping:
    """False until a signal asks the process to end."""

    def __init__(self) -> None:
        self._told = False

    def __bool__(self) -> bool:
        return self._told

    def tell(self) -> None:
        """Note that the server is to end."""
        self._told = True

    def listen(self) -> None:
        """Hear the signals before the handlers that are set at this moment; only a main thread can."""
        if threading.current_thread() is not threading.main_thread():
            return
        for number in SIGNALS:
            self._hear(number)

    def _hear(self, number: signal.Signals) -> None:
        before = signal.getsignal(number)
        if not callable(before):
            return
        handler = before  # narrowed: a callable

        def handle(received: int, frame: FrameType | None) -> None:
            self.tell()
            handler(received, frame)

        signal.signal(number, handle)


# Work that the server looks for by itself while it runs.

Stopped = Callable[[], bool]
"""True once the server stops: asked by threads, which nobody can cancel."""


@asynccontextmanager
async def background_task(watch: Callable[[Stopped], Coroutine[Any, Any, None]]) -> AsyncIterator[None]:
    """Run a watch that never ends by itself while the block runs; its thread ends with its current piece.

    Parameters
    ----------
    watch : callable
        Gets the event that the server stops; canceled then.
    """
    stopped = threading.Event()
    watching = asyncio.create_task(watch(stopped.is_set))
    try:
        yield
    finally:
        stopped.set()
        watching.cancel()
        with suppress(asyncio.CancelledError):
            await watching
