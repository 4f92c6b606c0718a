"""A server process that begins with everything imported, which takes a fresh one three seconds."""

import multiprocessing
import os
import signal
import sys
from multiprocessing.context import ForkServerProcess
from pathlib import Path

from tests.browser.server_process import ServerProcess

_FORKS = multiprocessing.get_context("forkserver")
_FORKS.set_forkserver_preload(["server.cli_run", "server.app", "tests.browser.preloaded"])


class ForkedServer(ServerProcess):
    """`server run` in a separate process, forked from one that has imported the server.

    What it does from the command line on is what `python -m server run` does; only the imports are shared.
    """

    def _launch(self, environment: dict[str, str]) -> "Forked":
        process = _FORKS.Process(target=_serve, args=(self._arguments(), environment, self.log), daemon=True)
        process.start()
        return Forked(process)


class Forked:
    """A forked process, asked as a `subprocess.Popen` is."""

    def __init__(self, process: ForkServerProcess) -> None:
        self._process = process

    def send_signal(self, sig: int, /) -> None:
        """Send a signal to a process that may have ended."""
        if self._process.pid is not None and self._process.is_alive():
            os.kill(self._process.pid, sig)

    def wait(self, timeout: float | None = None) -> int:
        """Its exit status, once it has ended.

        Raises
        ------
        TimeoutError
            If it has not within `timeout` seconds.
        """
        self._process.join(timeout)
        if self._process.exitcode is None:
            raise TimeoutError(f"expected the server to end within {timeout} s, and it runs on")
        return self._process.exitcode

    def poll(self) -> int | None:
        """Its exit status; None while it runs."""
        return self._process.exitcode


def _serve(arguments: list[str], environment: dict[str, str], log: Path) -> None:
    from server.cli import main

    # The process that is forked ignores what Ctrl-C sends; a server heeds it.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.environ.clear()
    os.environ.update(environment)
    descriptor = os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
    os.dup2(descriptor, 1)
    os.dup2(descriptor, 2)
    sys.argv = arguments
    main()
