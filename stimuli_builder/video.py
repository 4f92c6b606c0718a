"""Video frames through PyAV: upright pictures, gray or RGB, read on a separate thread."""

from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from itertools import islice
from pathlib import Path
from queue import Full, Queue
from threading import Event, Thread
from types import TracebackType
from typing import Any, Self

import av
import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from experiments.files import check_target, remove_quietly, temporary_beside

# When the frames of a video are shown, from its packets; a varying rate; a truncated end.

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
    stamps, tick_s, reached_s = _clock_packets(path, container, stream)
    declared = int(stream.frames or 0)
    if declared and len(stamps) < declared and _held_frames(path) < declared:
        raise DamagedFileError(
            f"{path}: truncated: it declares {declared} frames but has {len(stamps)}; copy the file again"
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


def _clock_packets(path: Path, container: Any, stream: Any) -> tuple[Stamps, float, float]:
    """Stamps of the video's frames, seconds per tick, and where the last packet of any stream ends."""
    times, timeless = array("q"), False
    reached_s = 0.0
    # The declared length counts from the first stamp, which need not be 0.
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
    # Packets come in the order of decoding, in which a frame may precede one that is shown earlier.
    return np.sort(np.frombuffer(times, np.int64)), float(stream.time_base), reached_s


def reason(error: Exception) -> str:
    """First line of what FFmpeg says."""
    return str(getattr(error, "strerror", None) or error).split("\n")[0]


Picture = NDArray[np.uint8]

BATCH_FRAMES = 8
WAITING_BATCHES = 6
PICTURE_FORMATS = ("_pipe", "image2")
"""How FFmpeg's names of what reads pictures end, single ones and those that follow one another in a file."""
LUMA_FIRST = ("yuv4", "yuvj4", "nv12", "nv21", "gray8", "yuva4")


@dataclass(frozen=True)
class VideoInfo:
    """What a scan of the packets reveals, before a single frame is decoded.

    Attributes
    ----------
    times_s : float64 array (frames,)
        Presentation time of every frame, from 0, ascending.
    size_px : (int, int)
        Width and height as displayed, after the rotation a phone writes into the file.
    fps : float
        Frames divided by time; `variable` says that the steps between frames differ.
    damaged : bool
        The file ends, or cannot be read, before what it declares; the frames are those before that.
    """

    path: Path
    size_px: tuple[int, int]
    fps: float
    times_s: NDArray[np.float64]
    stamps: NDArray[np.int64]
    variable: bool
    damaged: bool = False

    @property
    def frame_count(self) -> int:
        """Number of frames in the file."""
        return len(self.times_s)


@contextmanager
def open_video(path: Path) -> Iterator[tuple[Any, Any]]:
    """Open a video: its container and first video stream, or one clear line."""
    if not path.is_file():
        raise InputError(f"{path}: there is no such video file; check the path")
    try:
        container = av.open(str(path))
    except (av.error.FFmpegError, ValueError) as error:
        empty = "; the file is empty" if not path.stat().st_size else ""
        raise InputError(f"{path}: not a video that can be read ({reason(error)}){empty}") from error
    with container:
        if container.format.name.endswith(PICTURE_FORMATS) and _packets(path, 2) < 2:
            raise InputError(f"{path}: expected a video, but this is a single picture")
        if not container.streams.video:
            raise InputError(f"{path}: expected a video stream, but the file has none")
        stream = container.streams.video[0]
        stream.thread_type = "AUTO"
        yield container, stream


def _packets(path: Path, limit: int) -> int:
    """How many pictures the first video stream holds, counted up to a limit."""
    with av.open(str(path)) as container:
        return sum(1 for _ in islice((packet for packet in container.demux(video=0) if packet.size), limit))


def grey(frame: Any) -> Picture:
    """Luminance of a decoded frame, uint8 (height, width), upright as players show it."""
    name = frame.format.name
    # Formats of 8 bits whose first plane is the luma; those of more bits end in le or be.
    if not name.startswith(LUMA_FIRST) or name.endswith(("le", "be")):
        frame = frame.reformat(format="gray")
    plane = frame.planes[0]
    # Rows may be padded to the decoder's alignment: the picture is the left part.
    rows = np.frombuffer(plane, np.uint8).reshape(-1, plane.line_size)
    return _upright(frame, rows[: frame.height, : frame.width])


def rgb(frame: Any) -> Picture:
    """Colors of a decoded frame, uint8 (height, width, 3), upright as players show it."""
    return _upright(frame, frame.to_ndarray(format="rgb24"))


def _upright(frame: Any, picture: Picture) -> Picture:
    turns = round(frame.rotation / 90) % 4
    return np.ascontiguousarray(np.rot90(picture, turns) if turns else picture)


def decode(path: Path, read: Callable[[Any], Picture] = grey) -> Iterator[tuple[int | None, Picture]]:
    """Time stamp and picture of each frame from the start; DamagedFileError at the first that is spoilt.

    A decoder fills spoilt parts of a frame from others and only marks it.
    """
    with open_video(path) as (container, stream):
        try:
            for number, frame in enumerate(container.decode(stream)):
                if frame.is_corrupt:
                    raise DamagedFileError(
                        f"{path}: damaged, frame {number} holds bytes that cannot be decoded; "
                        "copy the file again"
                    )
                yield frame.pts, read(frame)
        except av.error.FFmpegError as error:
            raise DamagedFileError(
                f"{path}: truncated or damaged ({reason(error)}); copy the file again"
            ) from error


def read_frames(info: VideoInfo, numbers: Sequence[int]) -> dict[int, Picture]:
    """Decode the frames with the given numbers, seeking to each; memory holds only these."""
    outside = [number for number in numbers if not 0 <= number < info.frame_count]
    if outside:
        raise InputError(
            f"{info.path}: frame {outside[0]} was requested, but the video has frames 0 to "
            f"{info.frame_count - 1}"
        )
    pictures: dict[int, Picture] = {}
    with open_video(info.path) as (container, stream):
        for number in sorted(set(numbers)):
            pictures[number] = _seek(info, container, stream, number)
    return pictures


def _seek(info: VideoInfo, container: Any, stream: Any, number: int) -> Picture:
    stamp = int(info.stamps[number])
    try:
        container.seek(stamp, stream=stream, backward=True)
        # The seek lands on a key frame before, from which decoding goes on to the frame that is meant.
        for frame in container.decode(stream):
            if frame.pts is not None and frame.pts >= stamp:
                return grey(frame)
    except av.error.FFmpegError as error:
        raise InputError(f"{info.path}: frame {number} cannot be decoded ({reason(error)})") from error
    raise InputError(f"{info.path}: frame {number} cannot be decoded; the file is damaged")


def frames(
    path: Path,
    prepare: Callable[[Picture], Picture] | None = None,
    read: Callable[[Any], Picture] = grey,
) -> Iterator[Picture]:
    """Every frame in order, decoded (and prepared) ahead on a thread; constant memory.

    Parameters
    ----------
    prepare : callable, optional
        Applied to each picture on the decoding thread, for instance to reduce its size.
    read : callable
        What to take from a decoded frame: `grey` or `rgb`.
    """
    waiting: Queue[list[Picture] | BaseException | None] = Queue(WAITING_BATCHES)
    stop = Event()
    thread = Thread(target=_produce, args=(path, prepare, read, waiting, stop), daemon=True, name="decoder")
    thread.start()
    try:
        while (batch := waiting.get()) is not None:
            if isinstance(batch, BaseException):
                raise batch
            yield from batch
    finally:
        stop.set()
        thread.join()


def _produce(
    path: Path,
    prepare: Callable[[Picture], Picture] | None,
    read: Callable[[Any], Picture],
    waiting: "Queue[list[Picture] | BaseException | None]",
    stop: Event,
) -> None:
    batch: list[Picture] = []
    try:
        for _, picture in decode(path, read):
            batch.append(prepare(picture) if prepare else picture)
            if len(batch) == BATCH_FRAMES:
                _put(waiting, batch, stop)
                batch = []
            if stop.is_set():
                return
        _put(waiting, batch, stop)
        _put(waiting, None, stop)
    except Exception as error:
        # The frames before the damage are good, and go out first.
        _put(waiting, batch, stop)
        _put(waiting, error, stop)


def _put(
    waiting: "Queue[list[Picture] | BaseException | None]",
    item: "list[Picture] | BaseException | None",
    stop: Event,
) -> None:
    while not stop.is_set():
        try:
            # With a time limit: else a consumer that has gone would leave this thread waiting for ever.
            waiting.put(item, timeout=0.2)
        except Full:
            continue
        return


# What a video file holds: size, rate and the time of every frame, also of a file that is damaged.

REORDERED_FRAMES = 16
"""Frames that may wait for others by H.264; where the end is missing, so many may be shown out of step."""


def scan_video(path: Path) -> VideoInfo:
    """Read every packet's time stamp (no decoding) and the displayed size.

    Raises
    ------
    InputError
        The file is missing, unreadable, truncated or holds no frame.
    """
    with open_video(path) as (container, stream):
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
    with open_video(path) as (container, stream):
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
    with open_video(path) as (container, stream):
        try:
            read_clock(path, container, stream)
        except DamagedFileError:
            return True
    return False


def declared_frames(info: VideoInfo) -> int:
    """How many frames a file declares, or its declared duration holds; 0 if it declares neither."""
    with open_video(info.path) as (container, stream):
        return int(stream.frames or round(_declared_s(container, stream) * info.fps))


def _declared_s(container: Any, stream: Any) -> float:
    """Duration of the video stream in seconds; of the whole file, sound included, if it declares no other."""
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


# Video frames out through PyAV: H.264 that is whole or absent.

ENDINGS = (".mp4", ".m4v", ".mov", ".mkv")


def check_video_name(path: Path) -> None:
    """Refuse a name that cannot be written as video, before any work is done."""
    check_target(path)
    if path.suffix.lower() not in ENDINGS:
        raise InputError(f"{path}: cannot be written as video; use a name in {', '.join(ENDINGS)}")


class VideoWriter:
    """Writes H.264 into a temporary name and renames it when the block ends without an error.

    Pictures are uint8: (height, width) gray or (height, width, 3) RGB; sides are even.
    """

    def __init__(
        self, path: Path, fps: float, size_px: tuple[int, int], *, crf: int = 18, preset: str = "veryfast"
    ):
        check_video_name(path)
        self.path = path
        self._temporary = temporary_beside(path, suffix=path.suffix)
        # A rate such as 30000/1001 comes as a float, and is exact again with a limited denominator.
        rate = Fraction(fps).limit_denominator(100_000)
        try:
            self._container = av.open(str(self._temporary), "w")
            self._stream: Any = self._container.add_stream("libx264", rate=rate)
        except (av.error.FFmpegError, ValueError, OSError) as error:
            remove_quietly(self._temporary)
            raise InputError(f"{path}: cannot be written as video ({reason(error)})") from error
        self._stream.width, self._stream.height = size_px
        self._stream.pix_fmt = "yuv420p"
        self._stream.options = {"crf": str(crf), "preset": preset, "x264-params": "log-level=error"}
        # One key frame a second, so that a seek decodes a second at most.
        self._stream.codec_context.gop_size = max(1, round(fps))

    def write(self, picture: Picture) -> None:
        """Append one gray or RGB picture."""
        form = "gray" if picture.ndim == 2 else "rgb24"
        self._encode(av.VideoFrame.from_ndarray(picture, format=form))

    def write_planes(self, planes: Picture) -> None:
        """Append one picture given as yuv420p planes stacked, uint8 (height * 3 / 2, width)."""
        self._encode(av.VideoFrame.from_ndarray(planes, format="yuv420p"))

    def _encode(self, frame: Any) -> None:
        for packet in self._stream.encode(frame):
            self._container.mux(packet)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                # None makes the encoder give out the frames that it still holds.
                for packet in self._stream.encode(None):
                    self._container.mux(packet)
            self._container.close()
            if kind is None:
                self._temporary.replace(self.path)
        finally:
            remove_quietly(self._temporary)
