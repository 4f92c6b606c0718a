"""Levels of an atlas as frames of one video: alike as they are, they take a fraction of single pictures.

H.264 in RGB planes: its decoding is exact by the standard, so every machine reads the same code values.
"""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.characters.declaration import Picture
from stimuli_builder.characters.writing import write_bytes_declared

QUANTISER = 7
"""x264's constant quantiser: 54 dB or more against the pictures given (decision 0636)."""
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
            "libx264rgb", rate=30, options={"qp": str(QUANTISER), "preset": "slow", "threads": "1"}
        )
        stream.width, stream.height, stream.pix_fmt = width, height, "rgb24"
        for picture in pictures:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode())
    return write_bytes_declared(folder, file, buffer.getvalue())


def decode_level_video(content: bytes, what: str, file: str) -> NDArray[np.uint8]:
    """(n, h, w, 3) sRGB code values of every frame; InputError where it is none or damaged."""
    try:
        with av.open(BytesIO(content)) as container:
            container.streams.video[0].thread_type = "AUTO"
            frames: list[Any] = [_rgb(frame) for frame in container.decode(video=0)]
    except (av.error.FFmpegError, ValueError, IndexError) as error:
        raise InputError(f"{what} is damaged: cannot decode {file}; bake it again") from error
    if not frames:
        raise InputError(f"{what} is damaged: {file} holds no frame; bake it again")
    return _held_still(np.stack(frames))


def _held_still(frames: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The frames with every pixel that changes by no more than the encoder's own noise as in the first."""
    low, high = frames.min(axis=0), frames.max(axis=0)
    first = frames[0]
    moves = (np.maximum(high - first, first - low) > STILL_CODES).any(axis=-1)
    for frame in frames[1:]:
        np.copyto(frame, first, where=~moves[..., None])
    return frames


def _rgb(frame: Any) -> NDArray[np.uint8]:
    """Planes G, B, R of a decoded frame, without any conversion of colours."""
    if frame.format.name != "gbrp":
        raise ValueError(f"planes are {frame.format.name}, expected gbrp")
    planes = [
        np.frombuffer(plane, np.uint8).reshape(-1, plane.line_size)[: frame.height, : frame.width]
        for plane in frame.planes
    ]
    return np.stack([planes[2], planes[0], planes[1]], -1)
