"""Videos of every kind that people send: small, made on the spot, each frame unlike the others."""

from fractions import Fraction
from pathlib import Path
from typing import Any

import av

WIDTH, HEIGHT, FRAMES, FPS = 64, 48, 10, 25
AUDIO_RATE = 44_100


def frame_of(number: int, width: int = WIDTH, height: int = HEIGHT, pixels: str = "yuv420p") -> av.VideoFrame:
    """A sloping grey picture, lighter with each number."""
    grey = av.VideoFrame(width, height, "gray")
    size = grey.planes[0].buffer_size
    grey.planes[0].update(bytes((40 + place % 64 + 9 * number) % 256 for place in range(size)))
    return grey.reformat(format=pixels)


def write_video(
    path: Path,
    codec: str = "libx264",
    pixels: str = "yuv420p",
    *,
    frames: int = FRAMES,
    fps: int = FPS,
    size_px: tuple[int, int] = (WIDTH, HEIGHT),
    shown_at: list[int] | None = None,
    rotation_deg: int = 0,
    options: dict[str, str] | None = None,
    sound: bool = False,
) -> Path:
    """Write a video; `shown_at` are the times of its frames in units of 1 / fps where they are not equal."""
    times = shown_at or list(range(frames))
    with av.open(str(path), "w") as container:
        stream: Any = container.add_stream(codec, rate=fps)
        stream.width, stream.height = size_px
        stream.pix_fmt, stream.options = pixels, options or {}
        if rotation_deg:
            stream.set_display_rotation(rotation_deg)
        audio: Any = container.add_stream("aac", rate=AUDIO_RATE) if sound else None
        for number, time in enumerate(times):
            frame = frame_of(number, *size_px, pixels)
            frame.pts, frame.time_base = time, Fraction(1, fps)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
        if audio is not None:
            _add_sound(container, audio)
    return path


def write_sound(path: Path) -> Path:
    """A file with sound alone."""
    with av.open(str(path), "w") as container:
        _add_sound(container, container.add_stream("aac", rate=AUDIO_RATE))
    return path


def _add_sound(container: Any, stream: Any) -> None:
    frame = av.AudioFrame(format="fltp", layout="mono", samples=1024)
    frame.rate, frame.pts = AUDIO_RATE, 0
    for plane in frame.planes:
        plane.update(bytes(plane.buffer_size))
    container.mux(stream.encode(frame))
    container.mux(stream.encode(None))
