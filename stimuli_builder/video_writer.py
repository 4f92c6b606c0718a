"""Video frames out through PyAV: H.264 that is whole or absent."""

from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import av

from experiments.errors import InputError
from experiments.files import remove_quietly, temporary_beside
from stimuli_builder.video import Picture, reason

ENDINGS = (".mp4", ".m4v", ".mov", ".mkv")


def check_video_name(path: Path) -> None:
    """Refuse a name that cannot be written as video, before any work is done."""
    temporary_beside(path)
    if path.suffix.lower() not in ENDINGS:
        raise InputError(f"{path}: cannot be written as video; use a name in {', '.join(ENDINGS)}")


class VideoWriter:
    """Writes H.264 into a temporary name and renames it when the block ends without an error.

    Pictures are uint8: (height, width) grey or (height, width, 3) RGB; sides are even.
    """

    def __init__(
        self, path: Path, fps: float, size_px: tuple[int, int], *, crf: int = 18, preset: str = "veryfast"
    ):
        check_video_name(path)
        self.path = path
        self._temporary = temporary_beside(path, suffix=path.suffix)
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
