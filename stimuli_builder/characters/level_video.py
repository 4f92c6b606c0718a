"""Levels of an atlas as frames of one video: alike as they are, they take a fraction of single pictures.

H.264's decoding is exact by the standard, so every machine reads the same code values. Videos of earlier
bakes hold planes of R, G and B and are read as they are.
"""

from collections.abc import Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.characters.colour import FORMAT, frame_planes, picture_of, planes_of
from stimuli_builder.characters.declaration import REPAIR, Picture, write_bytes_declared

QUANTISER = 21
"""x264's constant quantiser of ten-bit planes: with 22 `alder@7` has 48.1 dB or more."""
STILL_CODES = 2
"""Code values that the encoder may change of a pixel which stands still: skin must not flicker."""


def write_level_video(folder: Path, file: str, pictures: Sequence[NDArray[np.uint8]]) -> Picture:
    """Write (h, w, 3) sRGB pictures of one size as a video; return what the declaration says of it."""
    height, width = pictures[0].shape[:2]
    buffer = BytesIO()
    with av.open(buffer, "w", format="matroska") as container:
        # One thread and no date in the header: the same pictures give the same bytes.
        container.flags |= 0x400
        stream = container.add_stream(
            "libx264", rate=30, options={"qp": str(QUANTISER), "preset": "slow", "threads": "1"}
        )
        stream.width, stream.height, stream.pix_fmt = width, height, FORMAT
        for picture in pictures:
            container.mux(stream.encode(_frame(picture)))
        container.mux(stream.encode())
    return write_bytes_declared(folder, file, buffer.getvalue())


class StillPixels:
    """Which pixels of pictures seen one after another change by no more than the encoder's own noise."""

    def __init__(self, first: NDArray[np.uint8]) -> None:
        self._first, self._low, self._high = first.copy(), first.copy(), first.copy()

    def see(self, picture: NDArray[np.uint8]) -> None:
        """Take in one more picture of code values."""
        np.minimum(self._low, picture, out=self._low)
        np.maximum(self._high, picture, out=self._high)

    def hold(self, pictures: NDArray[Any]) -> None:
        """Give such pixels of (n, h, w, 3) pictures, in whatever encoding, their value in the first."""
        off = np.maximum(self._high - self._first, self._first - self._low)
        still = ~(off > STILL_CODES).any(axis=-1, keepdims=True)
        for picture in pictures[1:]:
            np.copyto(picture, pictures[0], where=still)


def decode_level_video(content: bytes, what: str, file: str) -> NDArray[np.uint8]:
    """(n, h, w, 3) sRGB code values of every frame; InputError where it is none or damaged."""
    shown, frames = 0, np.empty((0, 0, 0, 3), np.uint8)
    for shown, frame in enumerate(video_frames(content, what, file), start=1):
        if shown == 1:
            # Into one array: a list of frames and their stack would be there twice.
            frames, still = np.empty((_count(content), *frame.shape), np.uint8), StillPixels(frame)
        frames[shown - 1] = frame
        still.see(frame)
    still.hold(frames[:shown])
    return frames[:shown]


def video_frames(content: bytes, what: str, file: str) -> Iterator[NDArray[np.uint8]]:
    """(h, w, 3) sRGB code values of frame after frame, still pixels with the encoder's noise.

    Raises
    ------
    InputError
        The content is no such video, is damaged, or holds no frame.
    """
    shown = 0
    try:
        with av.open(BytesIO(content)) as container:
            container.streams.video[0].thread_type = "AUTO"
            for frame in container.decode(video=0):
                yield _rgb(frame)
                shown += 1
    except (av.error.FFmpegError, ValueError, IndexError) as error:
        raise InputError(f"{what} is damaged: cannot decode {file}; {REPAIR}") from error
    if not shown:
        raise InputError(f"{what} is damaged: {file} has no frame; {REPAIR}")


def _count(content: bytes) -> int:
    """Frames at the most: every packet may be one."""
    with av.open(BytesIO(content)) as container:
        return sum(packet.size > 0 for packet in container.demux(video=0))


def _frame(picture: NDArray[np.uint8]) -> av.VideoFrame:
    frame = av.VideoFrame(picture.shape[1], picture.shape[0], FORMAT)
    for plane, content in zip(frame.planes, planes_of(picture), strict=True):
        rows = np.zeros((plane.height, plane.line_size // content.itemsize), content.dtype)
        rows[:, : content.shape[1]] = content
        plane.update(rows.tobytes())
    return frame


def _rgb(frame: Any) -> NDArray[np.uint8]:
    """Code values of a decoded frame, by our own conversion of colors alone."""
    if frame.format.name not in (FORMAT, "gbrp"):
        raise ValueError(f"planes are {frame.format.name}, expected {FORMAT} or gbrp")
    planes = frame_planes(frame)
    if frame.format.name == FORMAT:
        return picture_of(planes)
    return np.stack([planes[2], planes[0], planes[1]], -1)
