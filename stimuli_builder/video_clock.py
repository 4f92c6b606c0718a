"""When the frames of a video are shown, told from its packets; a varying rate; an end that is cut off."""

from array import array
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError

Times = NDArray[np.float64]
Stamps = NDArray[np.int64]

VARIABLE_STEP = 0.25
VARIABLE_SHARE = 0.005
LONGEST_TICK = 0.5
MISSING_S = 0.1
MISSING_STEPS = 3


class DamagedFileError(InputError):
    """A file holds less than it declares, or breaks off; what comes before the damage may be read."""


@dataclass(frozen=True)
class Clock:
    """Presentation stamps (frames,) ascending, times in seconds from 0, rate, and whether steps differ."""

    stamps: Stamps
    times_s: Times
    fps: float
    variable: bool


def read_clock(path: Path, container: Any, stream: Any) -> Clock:
    """Read the time stamp of every packet of an open video, without decoding.

    Raises
    ------
    InputError
        The file holds no frame, or less than its head declares: frames, or seconds where it counts none.
    """
    stamps, tick_s, reached_s = _packets(path, container, stream)
    declared = int(stream.frames or 0)
    if declared and len(stamps) < declared and _held_frames(path) < declared:
        raise DamagedFileError(
            f"{path}: truncated, it declares {declared} frames and holds {len(stamps)}; copy the file again"
        )
    clock = clock_of(stamps, tick_s, float(1 / (stream.average_rate or 25)))
    declared_s = (container.duration or 0) / av.time_base
    if not declared and declared_s - reached_s > max(MISSING_S, MISSING_STEPS / clock.fps):
        raise DamagedFileError(
            f"{path}: truncated, it declares {declared_s:.1f} s and ends after {reached_s:.1f}; "
            "copy the file again"
        )
    return clock


def _held_frames(path: Path) -> int:
    """How many frames the first video stream of a file holds, those too that an edit list hides.

    A trimmed MP4 or MOV keeps whole groups of pictures, and its edit list says which of them are shown.
    """
    try:
        with av.open(str(path), options={"ignore_editlist": "1"}) as container:
            return sum(1 for packet in container.demux(video=0) if packet.size)
    except (av.error.FFmpegError, ValueError):
        return 0


def clock_of(stamps: Stamps, tick_s: float, usual_step_s: float) -> Clock:
    """Times of the frames, from stamps in ticks.

    Some containers count milliseconds: a constant 300 frames/s is stamped 3, 3 and 4 ms apart there. Stamps
    that stay within a tick of an even grid are laid on it, where the tick is short against the step.

    Parameters
    ----------
    stamps : int64 array (frames,)
        Ascending.
    usual_step_s : float
        Step of a video of one frame.
    """
    times = (stamps - stamps[0]) * tick_s
    if len(times) < 2 or times[-1] <= 0:
        return Clock(stamps, times, 1 / usual_step_s, False)
    fps = (len(times) - 1) / float(times[-1])
    grid = np.arange(len(times)) / fps
    if tick_s <= LONGEST_TICK / fps and np.abs(times - grid).max() <= 1.001 * tick_s:
        return Clock(stamps, grid, fps, False)
    steps = np.diff(times)
    step = float(np.median(steps))
    variable = bool((np.abs(steps - step) > VARIABLE_STEP * step).mean() > VARIABLE_SHARE)
    return Clock(stamps, times, fps, variable)


def _packets(path: Path, container: Any, stream: Any) -> tuple[Stamps, float, float]:
    """Stamps of the video's frames, seconds a tick, and where the last packet of any stream ends."""
    times, timeless = array("q"), False
    reached_s = 0.0
    begun_s = (container.start_time or 0) / av.time_base
    try:
        for packet in container.demux():
            if packet.pts is not None:
                end = (packet.pts + (packet.duration or 0)) * packet.time_base
                reached_s = max(reached_s, float(end) - begun_s)
            if packet.stream_index == stream.index and packet.size and not packet.is_discard:
                timeless |= packet.pts is None
                times.append(packet.pts or 0)
    except av.error.FFmpegError as error:
        raise DamagedFileError(
            f"{path}: truncated or damaged ({reason(error)}); copy the file again"
        ) from error
    if not times:
        raise InputError(f"{path}: holds no video frame; it is empty or damaged: copy the file again")
    if timeless:
        return np.arange(len(times)), float(1 / (stream.average_rate or Fraction(25))), reached_s
    return np.sort(np.frombuffer(times, np.int64)), float(stream.time_base), reached_s


def reason(error: Exception) -> str:
    """First line of what FFmpeg says."""
    return str(getattr(error, "strerror", None) or error).split("\n")[0]
