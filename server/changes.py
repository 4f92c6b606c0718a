"""Whether anything was written since: told from process to process by PostgreSQL's LISTEN and NOTIFY.

A process that has written says so twice a second at most, on a connection of its own after its commit: a
NOTIFY within the transaction of a rating would have all commits of the database wait for one another. Streams
so look at their study when there may be something to see, and hardly ever when there is not.
"""

import logging
import threading
from collections.abc import Callable

import psycopg
from sqlalchemy.exc import SQLAlchemyError
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.changes_repository import heard_changes, say_changed
from server.db import Database

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
                LOG.warning("a change could not be told: %s", type(error).__name__)
            self._ends.wait(EVERY_S)

    def _listen(self) -> None:
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


class ChangesTold:
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
