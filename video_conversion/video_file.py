"""What a file that somebody sent is: every frame decoded once, or a plain sentence why it cannot be used."""

import re
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

import av
from av.error import FFmpegError

from experiments.manifest import ColourRange
from video_conversion.prepared import major_brand

# Frames on a grid of equal times: pure functions of the times at which frames begin.

STANDARD_RATES = tuple(
    Fraction(rate)
    for rate in (
        Fraction(24000, 1001), 24, 25, Fraction(30000, 1001), 30, 48, 50,
        Fraction(60000, 1001), 60, 100, 120, 144, 200, 240,
    )
)  # fmt: skip
TOLERANCE = 0.25
"""Share of the time between frames by which a frame may be off the grid while the rate counts as constant.
Containers round times to a millisecond, which at 240 frames per second is 0.12 of it."""
SNAP = 0.01
LONE_FRAME_RATE = Fraction(25)


def constant_rate(times_s: Sequence[float], candidates: Sequence[Fraction | None]) -> Fraction | None:
    """The first candidate rate on whose grid every frame begins; None where none fits.

    Parameters
    ----------
    times_s : sequence of float, shape (frames,)
        When each frame begins, ascending, in s.
    candidates : sequence of Fraction or None
        Frames per second, as the container says them; the mean rate is tried last.

    Returns
    -------
    Fraction or None
        Frames per second.
    """
    if len(times_s) < 2:
        return next((rate for rate in candidates if rate), LONE_FRAME_RATE)
    span = times_s[-1] - times_s[0]
    if span <= 0:
        return None
    mean = standard_rate((len(times_s) - 1) / span)
    fitting = (rate for rate in (*candidates, mean) if rate and _fits(times_s, rate))
    return next(fitting, None)


def _fits(times_s: Sequence[float], rate: Fraction) -> bool:
    step = float(1 / rate)
    off = (abs(time - times_s[0] - number * step) for number, time in enumerate(times_s))
    return max(off) <= TOLERANCE * step


def standard_rate(rate: float) -> Fraction:
    """The standard rate nearest to `rate` where it is within 1 %, else the rate to three decimals."""
    nearest = min(STANDARD_RATES, key=lambda standard: abs(float(standard) - rate))
    return nearest if abs(float(nearest) - rate) <= SNAP * rate else Fraction(round(rate * 1000), 1000)


def typical_rate(times_s: Sequence[float]) -> Fraction:
    """Frames per second of a variable rate: the inverse of the median time between frames."""
    steps = [later - earlier for earlier, later in pairwise(times_s) if later > earlier]
    return standard_rate(1 / median(steps)) if steps else LONE_FRAME_RATE


def frame_map(times_s: Sequence[float], end_s: float, rate: Fraction) -> tuple[int, ...]:
    """The frame of the original that each frame of the clip shows, both from 0.

    Frame k of the clip, on screen from k / f to (k + 1) / f after the start, shows the frame of the original
    that is there at the middle of that time:

    .. math:: m_k = \\max \\{ i : t_i - t_0 \\le (k + 1/2) / f \\}                                  (1)

    with t_i the time at which frame i begins and f the clip's rate. There are
    round((t_e - t_0) f) of them, at least one, with t_e the time at which the last frame ends.

    Parameters
    ----------
    times_s : sequence of float, shape (frames,)
        When each frame begins, ascending, in s; at least one.
    end_s : float
        When the last frame ends, in s.
    rate : Fraction
        Frames per second of the clip.

    Returns
    -------
    tuple of int
        Ascending, not below 0, below the number of frames.
    """
    start, step = times_s[0], float(1 / rate)
    count = max(1, round((end_s - start) / step))
    begins = [time - start for time in times_s]
    return tuple(max(0, bisect_right(begins, (number + 0.5) * step) - 1) for number in range(count))


MAX_S = 120.0
MAX_PX = 4096
MAX_FRAMES = 30_000
MAX_FPS = 1_000
MAX_PIXELS = 32_000_000_000
"""For all frames together: two minutes of 3840 x 2160 pixels at 30 frames per second take 29.9 billion."""
FORMATS = (
    "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpegts,mpeg,mpegvideo,gif,apng,flv,asf,ogg,mxf,"
    "yuv4mpegpipe,h264,hevc,ivf,dv,nut"
)
"""Demuxers that read one file and nothing else: a playlist would open whatever address it names."""
OPEN_OPTIONS = {"protocol_whitelist": "file", "format_whitelist": FORMATS}
WIDE_COLOUR, HDR_TRANSFERS = 9, (16, 18)
RANGES: dict[int, ColourRange] = {1: "limited", 2: "full"}
READ_AGAIN = "export it again from the program that made it"


class NotAClip(Exception):
    """The file cannot be shown; the message says why, and what would do."""


@dataclass(frozen=True)
class VideoFile:
    """A file's first video, by its container and by every decoded frame.

    Attributes
    ----------
    container, codec, profile, pixel_format : str
        As FFmpeg calls them.
    brand : str
        The major brand in the first box of an MP4 or QuickTime file, such as isom; empty where there is none.
    is_edited : bool
        True where an edit list hides, repeats or reorders stored frames.
    colour_range, matrix : str and int
        Range, and the number of the matrix (ITU-T H.273); 2 where the file does not say.
    width_px, height_px : int
        Of stored pictures.
    pixel_aspect : Fraction
        Width of a pixel over its height.
    rotation_deg : int
        By how much pictures are turned counter-clockwise to be shown: 0, 90, 180 or 270.
    other_streams : tuple of str
        Kinds of what else the file holds, such as audio.
    has_alpha : bool
        True where pixels may be transparent.
    times_s : tuple of float, shape (frames,)
        When each frame begins, ascending, in s.
    end_s : float
        When the last frame ends, in s.
    rate : Fraction or None
        Frames per second where the rate is constant; None where it varies.
    """

    container: str
    brand: str
    is_edited: bool
    codec: str
    profile: str
    pixel_format: str
    colour_range: ColourRange
    matrix: int
    width_px: int
    height_px: int
    pixel_aspect: Fraction
    rotation_deg: int
    other_streams: tuple[str, ...]
    has_alpha: bool
    times_s: tuple[float, ...]
    end_s: float
    rate: Fraction | None

    @property
    def typical_rate(self) -> Fraction:
        """Frames per second: the constant rate, else the inverse of the median time between frames."""
        return self.rate or typical_rate(self.times_s)


@contextmanager
def open_container(path: Path, *, with_edits: bool = True) -> Iterator[Any]:
    """The file as a container, without its edit list if `with_edits` is false; NotAClip where it is none."""
    options = OPEN_OPTIONS if with_edits else OPEN_OPTIONS | {"ignore_editlist": "1"}
    try:
        with av.open(str(path), options=options, metadata_errors="ignore") as container:
            yield container
    except MemoryError:
        raise
    except (FFmpegError, ValueError, EOFError) as error:
        raise NotAClip(f"it cannot be read as a video, it may be damaged; {READ_AGAIN}") from error


def examine(path: Path) -> VideoFile:
    """Decode every frame of a file's first video.

    Raises
    ------
    NotAClip
        It is not a video, damaged, interlaced, in HDR or wide-gamut colors, or beyond a limit. What the
        container says of rate, frames and pixels is checked before the first frame is decoded.
    """
    stored = _stored_packets(path, with_edits=False)
    is_edited = stored != _stored_packets(path, with_edits=True)
    with open_container(path) as container:
        stream = container.streams.video[0]
        frames = _Frames()
        for frame in _decoded(container, stream):
            frames.add(frame)
        return _described(container, stream, frames, brand=major_brand(path), is_edited=is_edited)


def _stored_packets(path: Path, *, with_edits: bool) -> list[int | None]:
    """Where each packet of the video is in the file, in the order of decoding, except those that are hidden.

    NotAClip where the container holds more than a clip may: packets are counted, and none is decoded.
    """
    with open_container(path, with_edits=with_edits) as container:
        if not container.streams.video:
            held = ", ".join(sorted({stream.type for stream in container.streams})) or "nothing"
            raise NotAClip(f"it holds {held} and no picture; expected a video")
        stream = container.streams.video[0]
        context = stream.codec_context
        _check_size(context, container.duration)
        pixels = context.width * context.height
        check_amount(stream.frames, pixels)
        count, earliest, latest = 0, None, None
        places: list[int | None] = []
        for packet in container.demux(stream):
            if not packet.size:
                continue
            count += 1
            check_amount(count, pixels)
            if not packet.is_discard:
                places.append(packet.pos)
            if packet.pts is not None:
                earliest = packet.pts if earliest is None else min(earliest, packet.pts)
                latest = packet.pts if latest is None else max(latest, packet.pts)
        if earliest is not None and latest is not None and count > 1:
            _check_rate(count, float((latest - earliest) * stream.time_base))
        return places


def _check_rate(count: int, span_s: float) -> None:
    if count - 1 > MAX_FPS * span_s:
        had = f"{(count - 1) / span_s:.0f}" if span_s > 0 else "any number of"
        raise NotAClip(f"it has {had} frames per second; make it at most {MAX_FPS} frames per second")


def check_amount(frames: int, pixels: int) -> None:
    """NotAClip where there are more frames, or more pixels in all frames together, than a clip may have."""
    if frames > MAX_FRAMES:
        raise NotAClip(f"it has more than {MAX_FRAMES} frames; cut it shorter")
    if frames * pixels > MAX_PIXELS:
        raise NotAClip(
            f"it has at least {frames} frames of {pixels / 1e6:.3g} megapixels; cut it or scale it down to "
            f"at most {MAX_PIXELS / 1e9:.0f} billion pixels in all"
        )


def _check_size(context: Any, duration_us: int | None) -> None:
    if context is None or not context.width or not context.height:
        raise NotAClip(f"its pictures have no size; {READ_AGAIN}")
    if max(context.width, context.height) > MAX_PX:
        raise NotAClip(
            f"it has {context.width} x {context.height} pixels; scale it to at most {MAX_PX} a side"
        )
    if duration_us is not None and duration_us / 1e6 > MAX_S + 1:
        raise NotAClip(f"it lasts {duration_us / 1e6:.0f} s; cut it to at most {MAX_S:.0f} s")


def _decoded(container: Any, stream: Any) -> Iterator[Any]:
    """Each frame; NotAClip for the first that is damaged, which a decoder would else patch up."""
    # A stream may change its size on the way: no picture larger than the largest allowed is ever decoded.
    stream.codec_context.options = {"err_detect": "explode", "max_pixels": str(MAX_PX * MAX_PX)}
    number = 0
    try:
        for frame in container.decode(stream):
            if frame.is_corrupt:
                raise NotAClip(f"its frame {number} is damaged; {READ_AGAIN}")
            number += 1
            check_amount(number, frame.width * frame.height)
            yield frame
    except MemoryError:
        raise
    except (FFmpegError, ValueError) as error:
        raise NotAClip(f"it cannot be decoded after its frame {number}; {READ_AGAIN}") from error


class _Frames:
    """What has been seen of the frames so far."""

    def __init__(self) -> None:
        self.times_s: list[float] = []
        self.last_s = 0.0
        self.first: Any = None

    def add(self, frame: Any) -> None:
        """Take note of one frame; NotAClip where it is not like the first."""
        if frame.time is None:
            raise NotAClip(f"its frames bear no times; {READ_AGAIN}")
        if self.first is None:
            self.first = frame
        if frame.interlaced_frame:
            raise NotAClip(
                "it is interlaced (each frame holds two half pictures); make it progressive with "
                "`ffmpeg -i FILE -vf bwdif OUT.mp4`"
            )
        if (frame.width, frame.height) != (self.first.width, self.first.height):
            raise NotAClip(f"its pictures change their size at frame {len(self.times_s)}; {READ_AGAIN}")
        if self.times_s and frame.time <= self.times_s[-1]:
            raise NotAClip(f"its frame {len(self.times_s)} begins no later than the one before; {READ_AGAIN}")
        self.times_s.append(frame.time)
        self.last_s = float((frame.duration or 0) * frame.time_base)


def _described(container: Any, stream: Any, frames: _Frames, *, brand: str, is_edited: bool) -> VideoFile:
    first, times = frames.first, frames.times_s
    if first is None:
        raise NotAClip(f"it holds no frame; {READ_AGAIN}")
    if first.color_trc in HDR_TRANSFERS or first.colorspace in (WIDE_COLOUR, WIDE_COLOUR + 1):
        raise NotAClip("its colours are HDR or wide-gamut (BT.2020); export it in BT.709 (SDR)")
    rate = constant_rate(times, (stream.average_rate, stream.guessed_rate))
    step = float(1 / (rate or typical_rate(times) or LONE_FRAME_RATE))
    end = times[-1] + (step if rate else frames.last_s or step)
    if end - times[0] > MAX_S:
        raise NotAClip(f"it lasts {end - times[0]:.0f} s; cut it to at most {MAX_S:.0f} s")
    pixels = first.format
    is_rgb, is_full = pixels.is_rgb, pixels.name.startswith("yuvj") or pixels.is_rgb
    return VideoFile(
        container=container.format.name,
        brand=brand,
        is_edited=is_edited,
        codec=stream.codec_context.name,
        profile=str(stream.codec_context.profile or ""),
        pixel_format=pixels.name,
        colour_range="full" if is_full else RANGES.get(first.color_range, "not said"),
        matrix=0 if is_rgb else int(first.colorspace),
        width_px=first.width,
        height_px=first.height,
        pixel_aspect=stream.sample_aspect_ratio or Fraction(1),
        rotation_deg=round(first.rotation / 90) * 90 % 360,
        other_streams=tuple(sorted({one.type for one in container.streams if one is not stream})),
        has_alpha=bool(re.search(r"rgba|bgra|argb|abgr|yuva|gbrap|ya8|ya16|pal8", pixels.name)),
        times_s=tuple(times),
        end_s=end,
        rate=rate,
    )
