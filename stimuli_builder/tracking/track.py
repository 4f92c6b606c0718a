"""Tracking a recording into a table."""

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import islice
from pathlib import Path
from types import MappingProxyType

import numpy as np
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from experiments.errors import InputError
from stimuli_builder.compiled import compiled
from stimuli_builder.tracking.mesh import reduce_picture, reduced_points
from stimuli_builder.tracking.model import CoupledModel
from stimuli_builder.tracking.shapes import Points, widths
from stimuli_builder.tracking.stillness import Stillness
from stimuli_builder.tracking.table import TrackedFrame, TrackSummary, TrackWriter
from stimuli_builder.tracking.tracker import FROZEN, STILL, Tracker
from stimuli_builder.video import DamagedFileError, Picture, VideoInfo, frames

# Frames held back for two seconds: only what follows shows that a picture was frozen, or repeats regularly.

STOOD = "frozen picture: around the eyes it is the same as in neighboring frames"
STOOD_S = 0.5
STOOD_FRAMES = 5
"""The fewest frames of a picture that stands still; below 10 frames/s they last longer than half a second."""
ALIKE_SHARE = 0.01
ALIKE_LEVELS = 3.0
"""Pictures are alike where less than this share of the pixels about the eyes differs by more gray levels than
these. A codec's own changes stay below it but for the first frames; two people and the actor, as recorded and
compressed down to CRF 40, are like an earlier frame of theirs for 0.2 s at most."""
# A change of the frame rate repeats single frames, for a tenth of a second at most.
EVEN_RUN_S = 0.1
EVEN_REPEATS = 4
EVEN_SHARE = 0.9


class Hindsight:
    """Holds the last two seconds of frames and gives them on with what was learnt since.

    Attributes
    ----------
    repeated : int
        Frames that repeat the one before at even steps, as a change of the frame rate leaves them. They keep
        their status.
    """

    def __init__(self, fps: float, reduction: int):
        self.repeated = 0
        self._held: deque[TrackedFrame] = deque()
        self._window = Stillness(fps).window
        self._stood = max(STOOD_FRAMES, round(STOOD_S * fps))
        self._longest = max(1, round(EVEN_RUN_S * fps))
        # A reduced picture averages pixels, which shrinks their differences.
        self._levels = max(1, round(ALIKE_LEVELS / reduction))
        self._reduction = reduction
        self._first: Picture | None = None
        self._run, self._count = 0, 0
        self._repeats: deque[int] = deque()
        self._earlier: TrackedFrame | None = None

    def push(self, picture: Picture, frame: TrackedFrame) -> Iterator[TrackedFrame]:
        """Take in the next frame and its reduced picture; give on what is now two seconds old, if any."""
        self._run = self._run + 1 if self._like_first(picture) else 1
        if self._run == 1:
            self._begin(picture, frame)
        self._held.append(frame)
        if frame.reason == FROZEN:
            self._repeats.append(self._count)
        self._count += 1
        # All frames of the run so far, then each further one.
        if self._run == self._stood:
            self._doubt(self._run)
        elif self._run > self._stood:
            self._doubt(1)
        if len(self._held) > self._window:
            yield self._released()

    def flush(self) -> Iterator[TrackedFrame]:
        """Give on all that is held, at the end of the recording."""
        while self._held:
            yield self._released()

    def _begin(self, picture: Picture, frame: TrackedFrame) -> None:
        """Take the picture about the eyes (their box, their width on all sides) to compare with."""
        self._first = None
        if frame.points is not None:
            around = widths(frame.points)
            box = np.array([frame.points.min(0) - around, frame.points.max(0) + around])
            self._part = _slices(reduced_points(box, self._reduction), picture)
            # A copy: the decoder uses its pictures again.
            self._first = picture[self._part].copy()

    def _like_first(self, picture: Picture) -> bool:
        return self._first is not None and pictures_alike(
            picture[self._part], self._first, self._levels, ALIKE_SHARE
        )

    def _doubt(self, count: int) -> None:
        """Make the last frames doubtful that no more has been said of."""
        for back in range(1, min(count, len(self._held)) + 1):
            frame = self._held[-back]
            # A frame that was lost or doubtful for another reason keeps that.
            if frame.status in ("tracked", "reinitialised") or frame.reason in (FROZEN, STILL):
                self._held[-back] = replace(frame, status="doubtful", reason=STOOD)

    def _released(self) -> TrackedFrame:
        frame = self._held.popleft()
        # Two windows: a frame is judged by the repeats before it and by those after it.
        oldest = self._count - 2 * self._window
        while self._repeats and self._repeats[0] < oldest:
            self._repeats.popleft()
        # Even repeats are a property of the file, not a frozen camera.
        if frame.reason == FROZEN and evenly_repeated(list(self._repeats), self._longest):
            self.repeated += 1
            frame = self._as_before(frame)
        self._earlier = frame
        return frame

    def _as_before(self, repeat: TrackedFrame) -> TrackedFrame:
        """A repeat with the status of the frame that it repeats: its doubts are the same."""
        earlier = self._earlier
        if earlier is None or earlier.status == "lost":
            return repeat
        # The repeat itself was not found again.
        status = "tracked" if earlier.status == "reinitialised" else earlier.status
        return replace(repeat, status=status, reason=earlier.reason)


def _slices(box: Points, picture: Picture) -> tuple[slice, slice]:
    """Rows and columns of a picture within a box (2, 2), at least one of each."""
    last = np.array(picture.shape[::-1]) - 1
    (left, top), (right, bottom) = np.clip(box, 0, last).astype(int).tolist()
    return slice(top, bottom + 1), slice(left, right + 1)


def evenly_repeated(repeats: list[int], longest: int) -> bool:
    """Whether frames that repeat the one before lie as a change of the frame rate leaves them.

    Parameters
    ----------
    repeats : list of int
        Their numbers, ascending.
    longest : int
        The most that follow one another.

    Examples
    --------
    >>> evenly_repeated([1, 3, 5, 7, 9], 3)
    True
    >>> evenly_repeated([1, 3, 22, 23, 60], 3)
    False
    """
    if len(repeats) < EVEN_REPEATS:
        return False
    steps = np.diff(repeats)
    apart = np.flatnonzero(steps > 1)
    # Lengths of runs of repeats without a gap between them.
    runs = np.diff(np.concatenate([[-1], apart, [len(steps)]]))
    if runs.max() > longest:
        return False
    # The usual step, and one to each side of it: rates seldom divide evenly.
    least = int(np.median(steps))
    return any(np.isin(steps, (step, step + 1)).mean() >= EVEN_SHARE for step in (least - 1, least))


@compiled
def pictures_alike(one: Picture, other: Picture, levels: int, share: float) -> bool:
    """Whether at most a share of the pixels of two gray pictures differs by more gray levels than given."""
    allowed = share * one.shape[0] * one.shape[1]
    count = 0
    for row in range(one.shape[0]):
        for column in range(one.shape[1]):
            # sums, as a difference of unsigned levels would wrap around
            low, high = min(one[row, column], other[row, column]), max(one[row, column], other[row, column])
            count += high > low + levels
        # A row at a time: enough, and cheaper than a test for each pixel.
        if count > allowed:
            return False
    return True


def track_video(
    model: CoupledModel,
    info: VideoInfo,
    out: Path,
    advance: Callable[[TrackSummary], None] | None = None,
    hints: Mapping[int, Points | str] = MappingProxyType({}),
) -> TrackSummary:
    """Track every frame of a video into a CSV; memory does not grow with its length.

    Parameters
    ----------
    advance : callable, optional
        Called after each frame with the counts so far, which lag by two seconds, for a progress bar.
    hints : mapping of int to float64 array or str, optional
        Frame looked at by a detector -> its points, or why there are none: it saw no such eyes, not wholly in
        the picture, or covered ones; see `Tracker.step`.

    Raises
    ------
    InputError
        The video differs in size from the labeled one, breaks off, or shows no such eyes at all. Nothing is
        left under the name `out` then.
    """
    if model.size_px != info.size_px:
        raise InputError(
            f"{info.path}: {info.size_px[0]} x {info.size_px[1]} pixels, but the model was trained on "
            f"{model.size_px[0]} x {model.size_px[1]}; label frames of this video"
        )
    tracker, summary = Tracker(model, info.fps), TrackSummary()
    hindsight = Hindsight(info.fps, model.reduction)
    begun = time.perf_counter()
    # a second thread for matrices this small only waits, on the core that decodes
    with threadpool_limits(1, "blas"), TrackWriter(out, model.eyes) as writer:
        pictures = frames(info.path, lambda full: reduce_picture(full, model.reduction))
        for number, picture in enumerate(islice(pictures, info.frame_count)):
            # Time of this thread: decoding in other threads does not count as fitting.
            before = time.thread_time()
            hint = hints.get(number)
            if hint is not None:
                tracker.look(hint)
            frame = tracker.step(picture, None if isinstance(hint, str) else hint)
            known = list(hindsight.push(picture, frame))
            summary.fit_s += time.thread_time() - before
            _write(known, info, writer, summary)
            if advance is not None:
                advance(summary)
        _write(hindsight.flush(), info, writer, summary)
        if advance is not None:
            advance(summary)
        summary.repeated = hindsight.repeated
        # Inside the writer's block: a refusal removes the unfinished table.
        _refuse_nothing(info, summary)
    summary.total_s = time.perf_counter() - begun
    return summary


def _write(
    known: Iterable[TrackedFrame], info: VideoInfo, writer: TrackWriter, summary: TrackSummary
) -> None:
    for frame in known:
        # Frames come in order, so the count is the number of the next one.
        writer.write(summary.frames, float(info.times_s[summary.frames]), frame)
        summary.count(frame)


def _refuse_nothing(info: VideoInfo, summary: TrackSummary) -> None:
    if summary.frames < info.frame_count:
        raise DamagedFileError(
            f"{info.path}: truncated or damaged, {summary.frames} of {info.frame_count} frames can be decoded"
        )
    if summary.tracked == 0:
        raise InputError(
            f"{info.path}: no eyes like the labeled ones were found in its {summary.frames} frames"
        )
