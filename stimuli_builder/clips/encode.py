"""Planes to H.264 in MP4: the same planes give the same bytes on the same machine."""

import ctypes
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError

CRF = 11.6
PRESET = "faster"
LESS_SEARCH = "subme=2:ref=1:weightp=0"
"""Otherwise `faster` spends a third of its time on searches that pictures with little motion do not need."""
X264 = (
    f"{LESS_SEARCH}:threads=1:lookahead-threads=1:sliced-threads=0:bframes=0:keyint=infinite:scenecut=0:"
    "colorprim=bt709:transfer=bt709:colormatrix=bt709:range=tv:log-level=error"
)
BT709, LIMITED_RANGE = 1, 1
M_PERTURB, ZEROES = -6, 255
"""For glibc's mallopt: it fills every block of memory with the complement of this byte when it is taken."""
RATED = f"{X264}:trellis=0:partitions=i8x8:aq-strength=0.6:me=dia"
"""Fewer bits for smooth skin and a lower CRF keep the lids as sharp as with trellis."""
_ALONE = f"{X264.replace('keyint=infinite', 'keyint=1')}:aq-mode=0:mbtree=0"


# Decision 0912: Clips are encoded with CRF 11.6, `faster`, less search and no trellis.
def encoder_signature(alone_qp: int | None = None) -> str:
    """Everything of the encoder that decides a clip's bytes; alone_qp as for `encode_clip`."""
    codec = ".".join(str(part) for part in av.library_versions["libavcodec"])
    settings = f"crf {CRF}; preset {PRESET}; {RATED}" if alone_qp is None else f"{PRESET}; {_alone(alone_qp)}"
    return f"libx264 via libavcodec {codec}; {settings}"


def _alone(qp: int) -> str:
    return f"{_ALONE}:qp={qp}"


def encode_clip(
    frames: Iterable[NDArray[np.uint8]],
    size_px: tuple[int, int],
    fps: float,
    *,
    alone_qp: int | None = None,
) -> bytes:
    """Encode 4:2:0 planes, each (height * 3 / 2, width), as an MP4 file.

    One array shown several times in a row is one picture, taken over once.
    One GOP, no B-frames, constant rate, index in front of the data (fast start), BT.709 limited range. With
    `alone_qp` every picture is coded separately at this quantizer: it is decoded the same whatever the others
    are, so that coding artifacts reveal nothing about the other pictures.

    Raises
    ------
    InputError
        The temporary folder cannot take the file (disk full).
    """
    # Fast start rewrites the file from its beginning, so it needs a real one.
    try:
        with tempfile.TemporaryDirectory(prefix="palpebra-clip-") as folder:
            path = Path(folder) / "clip.mp4"
            _write(path, frames, size_px, fps, alone_qp)
            return path.read_bytes()
    except OSError as error:
        raise InputError(
            f"the clip cannot be written to {tempfile.gettempdir()} ({error.strerror}); free up space or set "
            "TMPDIR"
        ) from error


@contextmanager
def _zeroed_memory() -> Iterator[None]:
    """Memory is zero when it is taken: vector code of libx264's macroblock tree reads some that it never set.

    In a fresh process that memory is zero nearly always, so that bytes differed in one clip of some hundreds.
    Other C libraries than glibc have no such switch. Painting goes without: its arrays are large to fill.
    """
    mallopt = _mallopt()
    if mallopt is None:
        yield
        return
    mallopt(M_PERTURB, ZEROES)
    try:
        yield
    finally:
        mallopt(M_PERTURB, 0)


@cache
def _mallopt() -> Callable[[int, int], int] | None:
    return getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None


def _write(
    path: Path,
    frames: Iterable[NDArray[np.uint8]],
    size_px: tuple[int, int],
    fps: float,
    alone_qp: int | None,
) -> None:
    # 30000/1001 and its like come out exact.
    rate = Fraction(fps).limit_denominator(1001)
    # Without the muxer's version and time, which would make equal clips differ.
    container_options = {"movflags": "+faststart", "fflags": "+bitexact"}
    with av.open(str(path), "w", format="mp4", options=container_options) as container:
        stream: Any = container.add_stream("libx264", rate=rate)
        stream.width, stream.height = size_px
        stream.pix_fmt = "yuv420p"
        usual = {"crf": str(CRF), "x264-params": RATED}
        rated = usual if alone_qp is None else {"x264-params": _alone(alone_qp)}
        stream.options = {"preset": PRESET, "profile": "high", **rated}
        context = stream.codec_context
        # More threads would change x264's decisions, and so the bytes; clips are encoded side by side
        # instead.
        context.thread_count = 1
        context.time_base = 1 / rate
        context.color_range = LIMITED_RANGE
        context.colorspace = context.color_primaries = context.color_trc = BT709
        shown, frame = None, None
        for number, planes in enumerate(frames):
            # A picture that rests lies in libav's memory already.
            if frame is None or planes is not shown:
                shown, frame = planes, _frame(planes, rate)
            frame.pts = number
            with _zeroed_memory():
                packets = stream.encode(frame)
            container.mux(packets)
        with _zeroed_memory():
            packets = stream.encode(None)
        container.mux(packets)


def _frame(planes: NDArray[np.uint8], rate: Fraction) -> av.VideoFrame:
    frame = av.VideoFrame.from_ndarray(planes, format="yuv420p")
    frame.time_base = 1 / rate
    frame.color_range, frame.colorspace = LIMITED_RANGE, BT709
    return frame
