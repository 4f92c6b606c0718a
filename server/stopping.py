"""Whether this server has been told to end: answers that go on for hours ask, and do not hold it up."""

import signal
import threading
from types import FrameType

SIGNALS = (signal.SIGTERM, signal.SIGINT)


class Stopping:
    """False until a signal tells the process to end."""

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
