"""What a video file holds: size, rate and the time of every frame, also of a file that is damaged."""

from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.video import VideoInfo, decode, opened
from stimuli_builder.video_clock import DamagedFileError, clock_of, read_clock

REORDERED_FRAMES = 16
"""Frames that may wait for others by H.264; where the end is missing, so many may be shown out of step."""


def scan_video(path: Path) -> VideoInfo:
    """Read every packet's time stamp (no decoding) and the displayed size.

    Raises
    ------
    InputError
        The file is missing, unreadable, truncated or holds no frame.
    """
    with opened(path) as (container, stream):
        clock = read_clock(path, container, stream)
    size_px = _displayed_size(path)
    return VideoInfo(path, size_px, clock.fps, clock.times_s, clock.stamps, clock.variable)


def scan_before_damage(path: Path) -> VideoInfo:
    """Scan a video as far as it can be decoded: all of it is decoded once, up to the first spoilt frame.

    Raises
    ------
    InputError
        The file is missing, no video, or holds no frame before the damage.
    """
    damaged = _ends_early(path)
    stamps: list[int] = []
    with opened(path) as (container, stream):
        rate = stream.average_rate or 25
        tick = stream.time_base
        try:
            for frame in container.decode(stream):
                if frame.pts is None:
                    damaged = True
                    break
                if frame.is_corrupt:
                    damaged = True
                    # Frames shown just before a spoilt one may have been predicted from it.
                    del stamps[-REORDERED_FRAMES:]
                    break
                stamps.append(frame.pts)
        except av.error.FFmpegError:
            damaged = True
    if not stamps:
        raise InputError(f"{path}: no frame can be decoded before the damage; copy the file again")
    read = np.array(stamps, np.int64)
    clock = clock_of(_in_step(read) if damaged else read, float(tick), float(1 / rate))
    size_px = _displayed_size(path)
    return VideoInfo(path, size_px, clock.fps, clock.times_s, clock.stamps, clock.variable, damaged)


def _ends_early(path: Path) -> bool:
    """Whether the packets break off or are too few for what is declared; decoding may end there silently."""
    with opened(path) as (container, stream):
        try:
            read_clock(path, container, stream)
        except DamagedFileError:
            return True
    return False


def declared_frames(info: VideoInfo) -> int:
    """How many frames a file declares, or its declared duration holds; 0 where it tells neither."""
    with opened(info.path) as (container, stream):
        return int(stream.frames or round(_declared_s(container, stream) * info.fps))


def _declared_s(container: Any, stream: Any) -> float:
    """Duration of the video stream in seconds; of the whole file, sound included, where it tells no other."""
    if stream.duration:
        return float(stream.duration * stream.time_base)
    try:
        hours, minutes, seconds = stream.metadata["DURATION"].split(":")  # Matroska: 00:00:01.240000000
        return 3600 * int(hours) + 60 * int(minutes) + float(seconds)
    except (KeyError, ValueError):
        return float((container.duration or 0) / av.time_base)


def _in_step(stamps: NDArray[np.int64]) -> NDArray[np.int64]:
    """Leave out the last frames from where one that should come between them is missing."""
    steps = np.diff(stamps)
    if not len(steps):
        return stamps
    tail = max(0, len(steps) - REORDERED_FRAMES)
    gaps = np.flatnonzero(steps[tail:] > 1.5 * np.median(steps))
    return stamps[: tail + int(gaps[0]) + 1] if len(gaps) else stamps


def _displayed_size(path: Path) -> tuple[int, int]:
    first = next(iter(decode(path)), None)
    if first is None:
        raise InputError(f"{path}: no frame can be decoded; the file is damaged")
    height, width = first[1].shape
    return width, height
