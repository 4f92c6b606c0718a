"""Video frames in and out through PyAV: grey pictures upright, read on a thread of their own."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from queue import Full, Queue
from threading import Event, Thread
from types import TracebackType
from typing import Any, Self

import av
import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.files import remove_quietly, temporary_beside

Picture = NDArray[np.uint8]

VARIABLE_STEP = 0.25
VARIABLE_SHARE = 0.005
BATCH_FRAMES = 8
WAITING_BATCHES = 6
LUMA_FIRST = ("yuv4", "yuvj4", "nv12", "nv21", "gray8", "yuva4")


@dataclass(frozen=True)
class VideoInfo:
    """What a scan of the packets tells, before a single frame is decoded.

    Attributes
    ----------
    times_s : float64 array (frames,)
        Presentation time of every frame, from 0, ascending.
    size_px : (int, int)
        Width and height as displayed, after the rotation a phone writes into the file.
    fps : float
        Frames divided by time; `variable` says that the steps between frames differ.
    """

    path: Path
    size_px: tuple[int, int]
    fps: float
    times_s: NDArray[np.float64]
    stamps: NDArray[np.int64]
    variable: bool

    @property
    def frame_count(self) -> int:
        """Number of frames in the file."""
        return len(self.times_s)


@contextmanager
def opened(path: Path) -> Iterator[tuple[Any, Any]]:
    """Open a video: its container and first video stream, or one clear line."""
    if not path.is_file():
        raise InputError(f"{path}: expected a video file, found none; check the path")
    try:
        container = av.open(str(path))
    except (av.error.FFmpegError, ValueError) as error:
        raise InputError(f"{path}: not a video that can be read ({_reason(error)})") from error
    with container:
        if not container.streams.video:
            raise InputError(f"{path}: expected a video stream, the file has none")
        stream = container.streams.video[0]
        stream.thread_type = "AUTO"
        yield container, stream


def _reason(error: Exception) -> str:
    return str(getattr(error, "strerror", None) or error).split("\n")[0]


def scan_video(path: Path) -> VideoInfo:
    """Read every packet's time stamp (no decoding) and the displayed size.

    Raises
    ------
    InputError
        The file is missing, unreadable, truncated or holds no frame.
    """
    with opened(path) as (container, stream):
        declared = int(stream.frames or 0)
        stamps, base = _packet_stamps(path, container, stream)
    if declared and len(stamps) < declared:
        raise InputError(
            f"{path}: truncated, it declares {declared} frames and holds {len(stamps)}; copy the file again"
        )
    times = (stamps - stamps[0]) * float(base)
    steps = np.diff(times)
    step = float(np.median(steps)) if len(steps) else float(1 / (stream.average_rate or 25))
    uneven = np.abs(steps - step) > VARIABLE_STEP * step
    variable = bool(uneven.mean() > VARIABLE_SHARE) if len(steps) else False
    fps = (len(times) - 1) / float(times[-1]) if len(times) > 1 else 1 / step
    return VideoInfo(path, _displayed_size(path), fps, times, stamps, variable)


def _packet_stamps(path: Path, container: Any, stream: Any) -> tuple[NDArray[np.int64], Fraction]:
    try:
        found = [packet.pts for packet in container.demux(stream) if packet.size and not packet.is_discard]
    except av.error.FFmpegError as error:
        raise InputError(f"{path}: truncated or damaged ({_reason(error)}); copy the file again") from error
    if not found:
        raise InputError(f"{path}: holds no video frame")
    if any(stamp is None for stamp in found):
        rate = stream.average_rate or Fraction(25)
        return np.arange(len(found), dtype=np.int64), Fraction(1) / rate
    return np.sort(np.asarray(found, np.int64)), stream.time_base


def _displayed_size(path: Path) -> tuple[int, int]:
    first = next(iter(_decode(path)), None)
    if first is None:
        raise InputError(f"{path}: no frame can be decoded; the file is damaged")
    height, width = first[1].shape
    return width, height


def grey(frame: Any) -> Picture:
    """Luminance of a decoded frame, uint8 (height, width), upright as players show it."""
    name = frame.format.name
    if not name.startswith(LUMA_FIRST) or name.endswith(("le", "be")):
        frame = frame.reformat(format="gray")
    plane = frame.planes[0]
    rows = np.frombuffer(plane, np.uint8).reshape(-1, plane.line_size)
    picture = rows[: frame.height, : frame.width]
    turns = round(frame.rotation / 90) % 4
    return np.ascontiguousarray(np.rot90(picture, turns) if turns else picture)


def _decode(path: Path) -> Iterator[tuple[int | None, Picture]]:
    with opened(path) as (container, stream):
        try:
            for frame in container.decode(stream):
                yield frame.pts, grey(frame)
        except av.error.FFmpegError as error:
            raise InputError(
                f"{path}: truncated or damaged ({_reason(error)}); copy the file again"
            ) from error


def read_frames(info: VideoInfo, wanted: Sequence[int]) -> dict[int, Picture]:
    """Decode the frames with the given numbers, seeking to each; memory holds only these."""
    outside = [number for number in wanted if not 0 <= number < info.frame_count]
    if outside:
        raise InputError(
            f"{info.path}: frame {outside[0]} is asked for, the video has frames 0 to {info.frame_count - 1}"
        )
    found: dict[int, Picture] = {}
    with opened(info.path) as (container, stream):
        for number in sorted(set(wanted)):
            found[number] = _seek(info, container, stream, number)
    return found


def _seek(info: VideoInfo, container: Any, stream: Any, number: int) -> Picture:
    stamp = int(info.stamps[number])
    try:
        container.seek(stamp, stream=stream, backward=True)
        for frame in container.decode(stream):
            if frame.pts is not None and frame.pts >= stamp:
                return grey(frame)
    except av.error.FFmpegError as error:
        raise InputError(f"{info.path}: frame {number} cannot be decoded ({_reason(error)})") from error
    raise InputError(f"{info.path}: frame {number} cannot be decoded; the file is damaged")


def frames(path: Path, prepare: Callable[[Picture], Picture] | None = None) -> Iterator[Picture]:
    """Every frame in order, decoded (and prepared) ahead on a thread; constant memory.

    Parameters
    ----------
    prepare : callable, optional
        Applied to each picture on the decoding thread, for instance to reduce its size.
    """
    waiting: Queue[list[Picture] | BaseException | None] = Queue(WAITING_BATCHES)
    stop = Event()
    thread = Thread(target=_produce, args=(path, prepare, waiting, stop), daemon=True, name="decoder")
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
    waiting: "Queue[list[Picture] | BaseException | None]",
    stop: Event,
) -> None:
    batch: list[Picture] = []
    try:
        for _, picture in _decode(path):
            batch.append(prepare(picture) if prepare else picture)
            if len(batch) == BATCH_FRAMES:
                _put(waiting, batch, stop)
                batch = []
            if stop.is_set():
                return
        _put(waiting, batch, stop)
        _put(waiting, None, stop)
    except Exception as error:
        _put(waiting, error, stop)


def _put(
    waiting: "Queue[list[Picture] | BaseException | None]",
    item: "list[Picture] | BaseException | None",
    stop: Event,
) -> None:
    while not stop.is_set():
        try:
            waiting.put(item, timeout=0.2)
        except Full:
            continue
        return


class VideoWriter:
    """Writes H.264 into a temporary name and renames it when the block ends without an error.

    Pictures are uint8: (height, width) grey or (height, width, 3) RGB; sides are even.
    """

    def __init__(
        self, path: Path, fps: float, size_px: tuple[int, int], *, crf: int = 18, preset: str = "veryfast"
    ):
        self.path = path
        self._temporary = temporary_beside(path, suffix=path.suffix or ".mp4")
        rate = Fraction(fps).limit_denominator(100_000)
        try:
            self._container = av.open(str(self._temporary), "w")
            self._stream: Any = self._container.add_stream("libx264", rate=rate)
        except (av.error.FFmpegError, ValueError, OSError) as error:
            remove_quietly(self._temporary)
            raise InputError(
                f"{path}: cannot be written as video ({_reason(error)}); use a name in .mp4"
            ) from error
        self._stream.width, self._stream.height = size_px
        self._stream.pix_fmt = "yuv420p"
        self._stream.options = {"crf": str(crf), "preset": preset, "x264-params": "log-level=error"}
        self._stream.codec_context.gop_size = max(1, round(fps))

    def write(self, picture: Picture) -> None:
        """Append one grey or RGB picture."""
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
                for packet in self._stream.encode(None):
                    self._container.mux(packet)
            self._container.close()
            if kind is None:
                self._temporary.replace(self.path)
        finally:
            remove_quietly(self._temporary)
