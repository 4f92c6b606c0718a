"""How long a browser's drawing threads waited for a processor: reported by the kernel, not by the page.

A picture can be lost for two reasons: the page was wrong, or other programs held the processors. The kernel
counts for each thread the time it was ready and did not run; a hypervisor that takes the processor away is
seen by this sampler itself waking late.
"""

import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType

import psutil

SAMPLE_S = 0.005
TREE_EVERY_S = 0.5
"""How often the browser's threads are listed again."""
DRAWING_THREADS = (
    "DedicatedWorker",
    "Compositor",
    "VizCompositor",
    "CrGpuMain",
    "Chrome_ChildIOT",
    "Chrome_IOThread",
    "DOM Worker",
    "IPC I/O",
    "Renderer",
    "SwComposite",
    "WRRende",
    "WRWorker",
    "Xvfb",
)
"""Between a refresh and the page's worker, by how the kernel's name begins; not the page's own thread."""


class ProcessorWaits:
    """Samples in a separate thread from ``with`` to its end.

    own_lateness: count the sampler's late waking as a wait; not where the browser goes before every
    ordinary program, the sampler too.
    """

    def __init__(self, own_lateness: bool = True) -> None:
        self.own_lateness = own_lateness
        self.waits: list[tuple[float, float, float]] = []
        """Beginning and end on the wall clock, and the longest wait of one thread within, all in ms."""
        self.is_over = threading.Event()
        self.thread = threading.Thread(target=self.sample, daemon=True)

    def __enter__(self) -> "ProcessorWaits":
        self.thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        self.is_over.set()
        self.thread.join()

    def within(self, start_ms: float, end_ms: float) -> float:
        """Time that a drawing thread waited between two moments of the wall clock, in ms."""
        return sum(waited for start, end, waited in self.waits if end > start_ms and start < end_ms)

    def sample(self) -> None:
        files: list[Path] = []
        listed_s, before_s, delays = 0.0, time.time(), dict[Path, float]()
        while not self.is_over.wait(SAMPLE_S):
            if time.time() - listed_s > TREE_EVERY_S:
                files, listed_s = list(drawing_threads()), time.time()
            now, now_s = {file: run_delay_ms(file) for file in files}, time.time()
            grown = [delay - delays[file] for file, delay in now.items() if file in delays]
            late_ms = 1000 * (now_s - before_s - SAMPLE_S) if self.own_lateness else 0.0
            waited = max([*grown, late_ms])
            self.waits.append((1000 * before_s, 1000 * now_s, waited))
            before_s, delays = now_s, now


def drawing_threads() -> Iterator[Path]:
    """The kernel's files of this process's browsers."""
    for process in psutil.Process().children(recursive=True):
        for task in Path(f"/proc/{process.pid}/task").glob("*"):
            try:
                name = (task / "comm").read_text()
            except OSError:
                continue
            if name.startswith(DRAWING_THREADS):
                yield task / "schedstat"


def run_delay_ms(file: Path) -> float:
    """Time a thread has waited for a processor since it began; 0 for one that has ended."""
    try:
        return int(file.read_text().split()[1]) / 1e6
    except (OSError, IndexError):
        return 0.0
