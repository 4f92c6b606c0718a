"""Video frames through PyAV: upright pictures, grey or RGB, read on a thread of their own."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from queue import Full, Queue
from threading import Event, Thread
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.video_clock import DamagedFileError, reason

Picture = NDArray[np.uint8]

BATCH_FRAMES = 8
WAITING_BATCHES = 6
PICTURE_FORMATS = ("_pipe", "image2")
"""How FFmpeg's names of what reads pictures end, single ones and those that follow one another in a file."""
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
def opened(path: Path) -> Iterator[tuple[Any, Any]]:
    """Open a video: its container and first video stream, or one clear line."""
    if not path.is_file():
        raise InputError(f"{path}: expected a video file, found none; check the path")
    try:
        container = av.open(str(path))
    except (av.error.FFmpegError, ValueError) as error:
        empty = "; the file is empty" if not path.stat().st_size else ""
        raise InputError(f"{path}: not a video that can be read ({reason(error)}){empty}") from error
    with container:
        if container.format.name.endswith(PICTURE_FORMATS) and _packets(path, 2) < 2:
            raise InputError(f"{path}: expected a video, this is a single picture")
        if not container.streams.video:
            raise InputError(f"{path}: expected a video stream, the file has none")
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
    if not name.startswith(LUMA_FIRST) or name.endswith(("le", "be")):
        frame = frame.reformat(format="gray")
    plane = frame.planes[0]
    rows = np.frombuffer(plane, np.uint8).reshape(-1, plane.line_size)
    return _upright(frame, rows[: frame.height, : frame.width])


def rgb(frame: Any) -> Picture:
    """Colours of a decoded frame, uint8 (height, width, 3), upright as players show it."""
    return _upright(frame, frame.to_ndarray(format="rgb24"))


def _upright(frame: Any, picture: Picture) -> Picture:
    turns = round(frame.rotation / 90) % 4
    return np.ascontiguousarray(np.rot90(picture, turns) if turns else picture)


def decode(path: Path, read: Callable[[Any], Picture] = grey) -> Iterator[tuple[int | None, Picture]]:
    """Time stamp and picture of each frame from the start; DamagedFileError at the first that is spoilt.

    A decoder fills spoilt parts of a frame from others and only marks it.
    """
    with opened(path) as (container, stream):
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
            f"{info.path}: frame {outside[0]} is asked for, the video has frames 0 to {info.frame_count - 1}"
        )
    pictures: dict[int, Picture] = {}
    with opened(info.path) as (container, stream):
        for number in sorted(set(numbers)):
            pictures[number] = _seek(info, container, stream, number)
    return pictures


def _seek(info: VideoInfo, container: Any, stream: Any, number: int) -> Picture:
    stamp = int(info.stamps[number])
    try:
        container.seek(stamp, stream=stream, backward=True)
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
        _put(waiting, batch, stop)
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
