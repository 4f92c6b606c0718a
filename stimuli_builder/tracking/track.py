"""Tracking a recording into a table."""

import time
from collections.abc import Callable, Iterable, Mapping
from itertools import islice
from pathlib import Path
from types import MappingProxyType

from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from experiments.errors import InputError
from stimuli_builder.tracking.hindsight import Hindsight
from stimuli_builder.tracking.model import CoupledModel
from stimuli_builder.tracking.outcome import TrackedFrame, TrackSummary
from stimuli_builder.tracking.picture import reduced
from stimuli_builder.tracking.shapes import Points
from stimuli_builder.tracking.table import TrackWriter
from stimuli_builder.tracking.tracker import Tracker
from stimuli_builder.video import DamagedFileError, VideoInfo, frames


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
        The video differs in size from the labelled one, breaks off, or shows no such eyes at all. Nothing is
        left under the name `out` then.
    """
    if model.size_px != info.size_px:
        raise InputError(
            f"{info.path}: {info.size_px[0]} x {info.size_px[1]} pixels, the model was trained on "
            f"{model.size_px[0]} x {model.size_px[1]}; label frames of this video"
        )
    tracker, summary = Tracker(model, info.fps), TrackSummary()
    hindsight = Hindsight(info.fps, model.reduction)
    begun = time.perf_counter()
    # a second thread for matrices this small only waits, on the core that decodes
    with threadpool_limits(1, "blas"), TrackWriter(out, model.eyes) as writer:
        pictures = frames(info.path, lambda full: reduced(full, model.reduction))
        for number, picture in enumerate(islice(pictures, info.frame_count)):
            before = time.thread_time()
            hint = hints.get(number)
            if hint is not None:
                tracker.look(hint)
            frame = tracker.step(picture, None if isinstance(hint, str) else hint)
            known = list(hindsight.after(picture, frame))
            summary.fit_s += time.thread_time() - before
            _write(known, info, writer, summary)
            if advance is not None:
                advance(summary)
        _write(hindsight.rest(), info, writer, summary)
        if advance is not None:
            advance(summary)
        summary.repeated = hindsight.repeated
        _refuse_nothing(info, summary)
    summary.total_s = time.perf_counter() - begun
    return summary


def _write(
    known: Iterable[TrackedFrame], info: VideoInfo, writer: TrackWriter, summary: TrackSummary
) -> None:
    for frame in known:
        writer.write(summary.frames, float(info.times_s[summary.frames]), frame)
        summary.count(frame)


def _refuse_nothing(info: VideoInfo, summary: TrackSummary) -> None:
    if summary.frames < info.frame_count:
        raise DamagedFileError(
            f"{info.path}: truncated or damaged, {summary.frames} of {info.frame_count} frames can be decoded"
        )
    if summary.tracked == 0:
        raise InputError(f"{info.path}: no eyes like the labelled ones in any of its {summary.frames} frames")
