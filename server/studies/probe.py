"""What an uploaded file is: a film that a browser can play, or a plain sentence why not."""

from dataclasses import dataclass
from pathlib import Path

import av
from av.error import FFmpegError

LONGEST_S = 120.0
LARGEST_PX = 4096
CODECS = ("h264",)
CONTAINERS = ("mp4", "mov")
CONVERT = "convert it with `ffmpeg -i FILE -c:v libx264 -pix_fmt yuv420p -an FILE.mp4`"


class NotAFilm(Exception):
    """The file cannot be shown; the message says why."""


@dataclass(frozen=True)
class Film:
    """Frame rate, frames and size of a film."""

    fps: float
    frames: int
    width_px: int
    height_px: int


def probe(path: Path) -> Film:
    """Read a film's shape by its packets, without decoding; NotAFilm where it cannot be shown."""
    try:
        with av.open(str(path), metadata_errors="ignore") as container:
            if not container.streams.video:
                raise NotAFilm("it holds no video; expected an MP4 with H.264 video")
            stream, container_names = container.streams.video[0], container.format.name.split(",")
            codec, fps = stream.codec_context.name, float(stream.average_rate or 0)
            width, height = stream.codec_context.width, stream.codec_context.height
            frames = sum(1 for packet in container.demux(stream) if packet.size)
    except (FFmpegError, ValueError) as error:
        raise NotAFilm("it cannot be read as a film; expected an MP4 with H.264 video") from error
    if not set(CONTAINERS) & set(container_names):
        raise NotAFilm(f"it is {container_names[0]} with {codec}; expected an MP4 with H.264: {CONVERT}")
    _check(codec, fps, frames, width, height)
    return Film(fps, frames, width, height)


def _check(codec: str, fps: float, frames: int, width: int, height: int) -> None:
    if codec not in CODECS:
        raise NotAFilm(f"its codec is {codec}; expected H.264, which every browser plays: {CONVERT}")
    if not 1 <= fps <= 240 or frames < 1:
        raise NotAFilm(
            f"expected 1 to 240 frames per second and at least one frame, got {fps:g} and {frames}"
        )
    if frames / fps > LONGEST_S:
        raise NotAFilm(f"it lasts {frames / fps:.0f} s; clips may last {LONGEST_S:.0f} s at most")
    if max(width, height) > LARGEST_PX:
        raise NotAFilm(f"it has {width} x {height} pixels; {LARGEST_PX} a side is the most")
