"""Whose video is next: accounts take turns, one file of each at a time, whatever folders they use."""

import time
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from server.transcoding.records import sender, uploads_in, waiting_in

LOOK_S = 1.0
LOOK_SHARE = 20
"""The folders are read again after at least 20 times as long as reading them took."""

Video = tuple[Path, Path]
"""The folder of an upload, and one of its files."""


@dataclass
class Turns:
    """The videos that wait, in one queue per account; the account served longest ago is next.

    Attributes
    ----------
    root : Path
        Folder of uploads.
    """

    root: Path
    _queues: dict[str, deque[Video]] = field(default_factory=dict)
    _served: dict[str, int] = field(default_factory=dict)
    _put_back: dict[Video, int] = field(default_factory=dict)
    _count: int = 0
    _look_at: float = 0.0

    def refresh(self, started: Iterable[Video] = (), *, now: bool = False) -> None:
        """Read which videos wait, except those that are started, at most every second."""
        begun = time.monotonic()
        if begun < self._look_at and not now:
            return
        queues: dict[str, deque[Video]] = {}
        taken = set(started)
        for folder in uploads_in(self.root):
            try:
                waiting = waiting_in(folder)
            except FileNotFoundError:  # discarded meanwhile
                continue
            if videos := [(folder, path) for path in waiting if (folder, path) not in taken]:
                queues.setdefault(sender(folder) or "", deque()).extend(videos)
        self._queues = {
            account: deque(sorted(queue, key=lambda video: self._put_back.get(video, 0)))
            for account, queue in queues.items()
        }
        ended = time.monotonic()
        self._look_at = ended + max(LOOK_S, LOOK_SHARE * (ended - begun))

    def accounts(self) -> list[str]:
        """The accounts that have a video waiting, those served longest ago first."""
        return self.in_order([account for account, queue in self._queues.items() if queue])

    def take(self, account: str) -> Video:
        """The next video of an account."""
        return self._queues[account].popleft()

    def put_last(self, account: str, video: Video) -> None:
        """Let a video wait behind the others of its account."""
        self._put_back[video] = self._put_back.get(video, 0) + 1
        self._queues.setdefault(account, deque()).append(video)

    def serve(self, account: str) -> None:
        """Note that the account has had its turn."""
        self._count += 1
        self._served[account] = self._count

    def in_order(self, accounts: list[str]) -> list[str]:
        """These accounts, those served longest ago first."""
        return sorted(accounts, key=lambda account: self._served.get(account, 0))
