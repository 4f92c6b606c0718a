"""The server's part: it starts the worker when videos have come, and again where it ended before its work."""

import logging
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path

from sqlalchemy.exc import SQLAlchemyError

from server.core.locks import Locks, LockTaken
from server.transcoding.records import uploads_in, waiting_in

LOG = logging.getLogger(__name__)
LOOK_AGAIN_S = 0.5
MAX_IDLE_STARTS = 12
END_S = 5.0
LOCK = "transcoding"


class UploadPreparation:
    """Has uploaded videos looked into and converted, in a separate process.

    Parameters
    ----------
    root : Path
        Folder of uploads.
    locks : Locks
        Of the server: where the folder is shared by several hosts, one of them is at it.
    """

    def __init__(self, root: Path, locks: Locks) -> None:
        self.root, self._locks = root, locks
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._asked = False
        self._closed = threading.Event()
        self._process: subprocess.Popen[bytes] | None = None

    def begin(self) -> None:
        """See to it that what waits is prepared; it returns at once."""
        with self._lock:
            self._asked = True
            if self._thread is None and not self._closed.is_set():
                self._thread = threading.Thread(target=self._run, name="preparing clips", daemon=True)
                self._thread.start()

    def close(self) -> None:
        """End the worker; what it has not done waits for the next server."""
        self._closed.set()
        with self._lock:
            process, thread = self._process, self._thread
        if process is not None:
            process.terminate()
        if thread is not None:
            thread.join(END_S)

    def _run(self) -> None:
        try:
            self._prepare()
        except Exception:
            LOG.exception("preparing clips")
        finally:
            with self._lock:
                if self._thread is threading.current_thread():
                    self._thread = None

    def _prepare(self) -> None:
        idle, before = 0, -1
        while self._goes_on() and idle < MAX_IDLE_STARTS:
            try:
                with self._locks.held(LOCK):
                    self._work()
            except LockTaken:  # another process is at it
                pass
            except (OSError, SQLAlchemyError):
                LOG.exception("preparing clips")
            waiting = self._waiting()
            idle = idle + 1 if waiting == before else 0
            before = waiting
            if waiting:
                # Another process is at it, or the worker ended at a file that it will refuse in time.
                self._closed.wait(LOOK_AGAIN_S * 2 ** min(idle, 4))

    def _goes_on(self) -> bool:
        with self._lock:
            goes_on = not self._closed.is_set() and (self._asked or self._waiting() > 0)
            self._asked = False
            if not goes_on:
                self._thread = None
            return goes_on

    def _waiting(self) -> int:
        waiting = 0
        for folder in uploads_in(self.root):
            with suppress(FileNotFoundError):  # removed meanwhile
                waiting += len(waiting_in(folder))
        return waiting

    def _work(self) -> None:
        command = [sys.executable, "-m", "server.transcoding.worker", str(self.root)]
        with self._lock:
            if self._closed.is_set() or not self.root.is_dir():
                return
            self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # noqa: S603
        self._process.wait()
        with self._lock:
            self._process = None
