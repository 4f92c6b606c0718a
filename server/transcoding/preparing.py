"""The server's part: it has uploads prepared, and clips of its store examined, in separate processes."""

import hashlib
import json
import logging
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from sqlalchemy.exc import SQLAlchemyError

from experiments.errors import counted
from experiments.manifest import CheckClip, Clip
from server.core.errors import ApiError
from server.core.locks import Locks, LockTaken
from server.core.storage import ClipStore, FolderStore
from server.transcoding.records import uploads_in, waiting_in
from server.transcoding.worker import address_limit, bound_memory, memory_of_machine, stand_back
from video_conversion.conversion import PLAYED_PROFILES
from video_conversion.video_file import NotAClip, examine

# Videos that have come: the worker is started, and again where it ended before its work.

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


# Clips as the store holds them: each is there, whole, and decodes to the frames its manifest declares.

LONGEST_S_A_CLIP = 120.0
HANGS_AFTER_S = 50.0
"""Of one clip where somebody waits: most of the time there is; else each further try would begin with it."""
AT_ONCE = 64
"""Clips of one process: starting one takes as long as a dozen short clips."""
RATE_TOLERANCE = 0.02
"""As the checklist's own test of clips in the browser has it."""


class ClipFault(NamedTuple):
    """What is wrong with one clip.

    Attributes
    ----------
    kind : {"missing", "undecodable", "different", "other_rate", "codec"}
    file : str
        Its name in the manifest.
    detail : str
        What was expected and found.
    """

    kind: str
    file: str
    detail: str


class StoredClips:
    """Examines clips of the store once each, in a separate process; safe to use from several threads.

    Parameters
    ----------
    store : ClipStore
    """

    def __init__(self, store: ClipStore) -> None:
        self._store = store
        self._known: dict[str, tuple[ClipFault, ...]] = {}
        self._turn = threading.Lock()
        self._background: threading.Thread | None = None

    def known_faults(self, clips: Sequence[Clip | CheckClip]) -> list[ClipFault]:
        """What is known by now, at once; clips that were never examined are examined in the background."""
        if any(_key(clip) not in self._known for clip in clips):
            self._begin(list(clips))
        faults = [fault for clip in clips for fault in self._faults_of(clip)]
        if isinstance(self._store, FolderStore):  # asking an object store for each would take seconds
            missing = {clip.file for clip in clips if self._store.size(clip.sha256) is None}
            faults = [fault for fault in faults if fault.file not in missing]
            faults += [ClipFault("missing", file, "no such file") for file in sorted(missing)]
        return faults

    def find_faults(self, clips: Sequence[Clip | CheckClip], within_s: float) -> tuple[list[ClipFault], int]:
        """Examine every clip that is not known to be fine.

        Parameters
        ----------
        clips : sequence of Clip or CheckClip
        within_s : float
            After this time, in s, no clip is begun and the one being decoded is given up: it is left for the
            next call. One that alone took `HANGS_AFTER_S` is reported as undecodable.

        Returns
        -------
        faults : list of ClipFault
        left : int
            How many clips there was no time for.
        """
        ends = time.monotonic() + within_s
        with self._turn:
            left = self._examine(clips, ends)
        return [fault for clip in clips for fault in self._faults_of(clip)], left

    def _faults_of(self, clip: Clip | CheckClip) -> list[ClipFault]:
        """What is known of a clip, under its own name: another study may call the same bytes otherwise."""
        return [fault._replace(file=clip.file) for fault in self._known.get(_key(clip), ())]

    def _begin(self, clips: list[Clip | CheckClip]) -> None:
        if self._background is None or not self._background.is_alive():
            self._background = threading.Thread(
                target=self._examine_quietly, args=(clips,), name="examining clips", daemon=True
            )
            self._background.start()

    def _examine_quietly(self, clips: list[Clip | CheckClip]) -> None:
        for start in range(0, len(clips), AT_ONCE):  # so that somebody who waits for an answer gets a turn
            with self._turn:
                try:
                    self._examine(clips[start : start + AT_ONCE], float("inf"))
                except ApiError:  # the object store is away; the next look begins again
                    return

    def _examine(self, clips: Sequence[Clip | CheckClip], ends: float) -> int:
        """Examine clips that are not known to be fine; return how many were left at `ends`."""
        asked = {}
        for clip in clips:
            size = self._store.size(clip.sha256)
            if size != clip.bytes:
                detail = "no such file" if size is None else f"expected {clip.bytes} bytes, got {size}"
                kind = "missing" if size is None else "different"
                self._known[_key(clip)] = (ClipFault(kind, clip.file, detail),)
            elif self._known.get(_key(clip)) or _key(clip) not in self._known:
                # A fault is looked at again: the clip may have been brought back.
                asked[_key(clip)] = clip
        # Last, as one that takes all of the time would keep it from the others each time.
        waiting = sorted(asked.values(), key=lambda clip: _key(clip) in self._known)
        while waiting and time.monotonic() < ends:
            done = self._examine_in_process(waiting[:AT_ONCE], ends)
            for clip, faults in done:
                self._known[_key(clip)] = faults
            waiting = waiting[len(done) :]
        return len(waiting)

    def _examine_in_process(
        self, clips: Sequence[Clip | CheckClip], ends: float
    ) -> list[tuple[Clip | CheckClip, tuple[ClipFault, ...]]]:
        """The first clips with what is wrong with them.

        At least one, as the process may end at a bad one; none only where the time is over at `ends` and the
        first clip had less than `HANGS_AFTER_S` of it.
        """
        with ExitStack() as held:
            orders = [{"path": str(self._path(clip, held)), **_expected(clip)} for clip in clips]
            longest_s = LONGEST_S_A_CLIP * len(clips)
            is_cut, began = False, time.monotonic()
            try:
                answer = subprocess.run(
                    [sys.executable, "-m", "server.transcoding.preparing"],
                    input=json.dumps(orders),
                    capture_output=True,
                    text=True,
                    timeout=max(0.0, min(longest_s, ends - time.monotonic())),
                    check=False,
                ).stdout
            except subprocess.TimeoutExpired as error:
                answer = (error.stdout or b"").decode()
                is_cut = time.monotonic() >= ends
        lines = [json.loads(line) for line in answer.splitlines() if line.endswith("]")]
        done = [
            (clip, tuple(ClipFault(kind, clip.file, detail) for kind, detail in faults))
            for clip, faults in zip(clips, lines, strict=False)
        ]
        hangs = is_cut and not done and time.monotonic() - began >= HANGS_AFTER_S
        if len(done) < len(clips) and (hangs or not is_cut):
            stopped = clips[len(done)]
            words = "decoding it took too long" if hangs else "it stopped the decoder"
            fault = ClipFault("undecodable", stopped.file, words)
            done.append((stopped, (fault,)))
        return done

    def _path(self, clip: Clip | CheckClip, held: ExitStack) -> Path:
        if isinstance(self._store, FolderStore):
            return self._store.path(clip.sha256)
        path = Path(held.enter_context(TemporaryDirectory(prefix="palpebra-clip-"))) / "clip.mp4"
        with path.open("wb") as stream:
            stream.writelines(self._store.read(clip.sha256, 0, clip.bytes))
        return path


def _key(clip: Clip | CheckClip) -> str:
    """Bytes of one hash may be declared with other frames in another study."""
    return json.dumps(_expected(clip))


def _expected(clip: Clip | CheckClip) -> dict[str, str | float]:
    names = ("sha256", "frames", "width_px", "height_px", "fps")
    return {name: getattr(clip, name) for name in names}


# The separate process: a decoder reads files that strangers may have made.


def examine_clips(orders: Iterable[dict[str, str | float]]) -> Iterator[list[tuple[str, str]]]:
    """For each clip the kinds and details of its faults."""
    for order in orders:
        yield list(_faults_of(order))


def _faults_of(expected: dict[str, str | float]) -> Iterator[tuple[str, str]]:
    path = Path(str(expected["path"]))
    try:
        with path.open("rb") as stream:
            sha256 = hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        yield "missing", str(error.strerror)
        return
    if sha256 != expected["sha256"]:
        yield "different", f"expected SHA-256 {str(expected['sha256'])[:12]}..., got {sha256[:12]}..."
        return
    try:
        video = examine(path)
    except (NotAClip, MemoryError) as error:
        yield "undecodable", str(error) or "its pictures need more memory than there is"
        return
    turned = video.rotation_deg in (90, 270)
    size = (video.height_px, video.width_px) if turned else (video.width_px, video.height_px)
    got = (len(video.times_s), *size)
    declared = tuple(int(expected[name]) for name in ("frames", "width_px", "height_px"))
    if got != declared:
        expected_text, got_text = (
            f"{counted(frames, 'frame')} of {width} x {height} pixels"
            for frames, width, height in (declared, got)
        )
        yield "different", f"expected {expected_text}, got {got_text}"
    rate, shown = float(video.typical_rate), float(expected["fps"])
    if len(video.times_s) > 1 and abs(rate / shown - 1) > RATE_TOLERANCE:
        yield "other_rate", f"shown at {shown:.1f}, recorded at {rate:.1f} frames per second"
    if video.codec != "h264" or video.profile not in PLAYED_PROFILES:
        yield "codec", f"{video.codec} {video.profile}".strip()


if __name__ == "__main__":
    stand_back()
    bound_memory(address_limit(memory_of_machine()))
    for faults in examine_clips(json.load(sys.stdin)):
        sys.stdout.write(json.dumps(faults) + "\n")
        sys.stdout.flush()
