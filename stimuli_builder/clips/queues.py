"""Which worker renders which job: a worker stays with a character, for reading one costs many clips."""

from collections import deque
from collections.abc import Hashable, Sequence
from itertools import pairwise

WORTH_READING = 32
"""Jobs that must wait elsewhere before a worker reads other levels for them.

Reading takes as long as 5 (a baked face) to 16 clips (the cartoon), and two share what waits.
"""


class JobQueues:
    """One queue a worker, each a run of the sorted jobs; whoever is done takes from the end of the longest.

    Parameters
    ----------
    jobs : sequence of int
        Numbers of the jobs to render, those painted from the same levels one after another.
    levels : sequence
        By the number of a job, what it is painted from; equal for equal levels.
    workers : int
        At most as many as jobs.
    """

    def __init__(self, jobs: Sequence[int], levels: Sequence[Hashable], workers: int) -> None:
        ends = [len(jobs) * worker // workers for worker in range(workers + 1)]
        self._queues = [deque(jobs[start:end]) for start, end in pairwise(ends)]
        self._levels = levels
        self._read: list[Hashable] = [None] * workers

    def take(self, worker: int) -> int | None:
        """The number of the next job of a worker; None where none is left that is worth its while."""
        own, longest = self._queues[worker], max(self._queues, key=len)
        if own:
            job = own.popleft()
        elif longest and (self._levels[longest[-1]] == self._read[worker] or len(longest) > WORTH_READING):
            job = longest.pop()
        else:
            return None
        self._read[worker] = self._levels[job]
        return job
