"""What has to be done to a video so that every browser shows it frame by frame, and doing it."""

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
from av.error import FFmpegError
from av.filter import Graph
from av.video.format import VideoFormat

from video_conversion.prepared import QUICKTIME
from video_conversion.video_file import (
    MAX_PX,
    READ_AGAIN,
    NotAClip,
    VideoFile,
    check_amount,
    frame_map,
    open_container,
)

# What has to be done to a video so that every browser shows it frame by frame: in words and figures.

PLAYED_PROFILES = ("Constrained Baseline", "Baseline", "Main", "High", "Progressive High", "Constrained High")
MIN_FPS, MAX_FPS = 1, 240
MAX_CLIP_FRAMES = 5_000
"""As many as the participant page plays, and the log of a view holds."""
HD_LINES = 720
BT601, BT709, RGB, NOT_SAID = 6, 1, 0, 2
MATRIX_NAMES = {1: "bt709", 4: "fcc", 5: "bt470bg", 6: "smpte170m", 7: "smpte240m"}
TURNS = {90: "transpose=cclock", 180: "hflip,vflip", 270: "transpose=clock"}


@dataclass(frozen=True)
class Conversion:
    """How one file becomes a clip.

    Attributes
    ----------
    rate : Fraction
        Frames per second of the clip.
    frame_map : tuple of int
        The frame of the original that each frame of the clip shows.
    filters : str
        What FFmpeg does to each picture before it is encoded.
    size_px : tuple of int
        Width and height of the clip, both even.
    changes : tuple of str
        What is done, in words; empty where the file is shown as it came.
    encodes : bool
        False where pictures stay as they are encoded.
    """

    rate: Fraction
    frame_map: tuple[int, ...]
    filters: str
    size_px: tuple[int, int]
    changes: tuple[str, ...]
    encodes: bool


def conversion_of(video: VideoFile, asked_fps: float | None) -> Conversion:
    """How `video` becomes a clip.

    Parameters
    ----------
    video : VideoFile
        What the file is.
    asked_fps : float or None
        Frames per second that clips are to have; None: each its own, which of a variable rate is the inverse
        of the median time between frames.

    Raises
    ------
    NotAClip
        Its own rate is outside of what is shown, and no other was asked for.
    """
    rate = Fraction(asked_fps).limit_denominator(1001) if asked_fps else video.typical_rate
    if not MIN_FPS <= rate <= MAX_FPS:
        raise NotAClip(
            f"it has {float(rate):g} frames per second; choose a rate of {MIN_FPS} to {MAX_FPS} for all clips"
        )
    turned_px, filters, picture_changes = _picture(video)
    # A frame that is shown for long is repeated: few frames may become many.
    check_amount(round((video.end_s - video.times_s[0]) * float(rate)), turned_px[0] * turned_px[1])
    keeps_times = video.rate is not None and abs(float(video.rate) - float(rate)) < 1e-6 * float(rate)
    shown = tuple(range(len(video.times_s))) if keeps_times else frame_map(video.times_s, video.end_s, rate)
    timing = () if keeps_times else (_timing_words(video, rate, shown),)
    changes = (*_stream_words(video), *timing, *picture_changes)
    copied = (*(() if changes else _container_words(video)), *_left_out(video))
    if len(shown) > MAX_CLIP_FRAMES:
        raise NotAClip(
            f"the clip would have {len(shown)} frames; cut it or choose a lower rate: at most "
            f"{MAX_CLIP_FRAMES} frames can be shown"
        )
    return Conversion(rate, shown, filters, turned_px, (*changes, *copied), encodes=bool(changes))


def _stream_words(video: VideoFile) -> tuple[str, ...]:
    """What of the form of the file, rather than of its pictures, keeps browsers from playing it."""
    is_h264 = video.codec == "h264" and video.profile in PLAYED_PROFILES
    if not is_h264:
        named = f"{video.codec} {video.profile}".strip() if video.codec == "h264" else video.codec
        return (f"encoded as H.264, was {named}",)
    if "mp4" not in video.container.split(","):
        return (f"re-encoded in an MP4 file, was {video.container.split(',')[0]}",)
    if video.is_edited:
        return ("frames as the edit list of the file says, which players apply differently",)
    return ()


def _container_words(video: VideoFile) -> tuple[str, ...]:
    """What is written into another file while pictures stay as they are encoded."""
    is_mp4 = "mp4" in video.container.split(",")
    if is_mp4 and video.brand in ("", QUICKTIME):
        return ("written as an MP4 file, was QuickTime",)
    return ()


def _timing_words(video: VideoFile, rate: Fraction, shown: tuple[int, ...]) -> str:
    had = f"{float(video.rate):.4g} fps" if video.rate else "a variable rate"
    left_out = len(video.times_s) - len(set(shown))
    repeated = len(shown) - len(set(shown))
    return f"{had} to {float(rate):.4g} fps: {repeated} frames repeated, {left_out} left out"


def _picture(video: VideoFile) -> tuple[tuple[int, int], str, tuple[str, ...]]:
    """Size of the clip, filters and words of what is done to pictures."""
    width, height = video.width_px, video.height_px
    filters, words = [], []
    if video.pixel_aspect not in (0, 1):
        width = max(2, round(width * video.pixel_aspect))
        if width > MAX_PX:
            raise NotAClip(
                f"its pixels are stretched to {width} x {height}; scale it to at most {MAX_PX} a side"
            )
        filters.append(f"scale={width}:{height}:flags=lanczos,setsar=1")
        words.append(f"stretched to square pixels, {width} x {height}")
    if video.rotation_deg:
        filters.append(TURNS[video.rotation_deg])
        words.append(f"turned by {_turn_words(video.rotation_deg)}, as the file says")
        width, height = (width, height) if video.rotation_deg == 180 else (height, width)
    even = (width - width % 2, height - height % 2)
    if 0 in even:
        raise NotAClip(f"it has {width} x {height} pixels; expected at least 2 x 2")
    if even != (width, height):
        filters.append(f"crop={even[0]}:{even[1]}:0:0:exact=1")
        words.append(f"cut to even sides, {even[0]} x {even[1]}")
    filters.append(_to_shown_pixels(video))
    return even, ",".join(filters), (*words, *_pixel_words(video))


def _turn_words(rotation_deg: int) -> str:
    return {90: "90 degrees to the left", 180: "180 degrees", 270: "90 degrees to the right"}[rotation_deg]


def _to_shown_pixels(video: VideoFile) -> str:
    matrix = video.matrix
    if matrix == NOT_SAID:
        matrix = BT709 if video.height_px >= HD_LINES else BT601
    said = "" if matrix == RGB else f"in_color_matrix={MATRIX_NAMES.get(matrix, 'bt709')}:"
    in_range = "full" if video.colour_range == "full" else "limited"
    return (
        f"scale={said}in_range={in_range}:out_color_matrix=bt709:out_range=limited:"
        "flags=lanczos+accurate_rnd+full_chroma_int+full_chroma_inp,format=yuv420p"
    )


def _pixel_words(video: VideoFile) -> tuple[str, ...]:
    words = []
    if video.pixel_format not in ("yuv420p", "yuvj420p"):
        words.append(f"pixels to 4:2:0 with 8 bits, were {video.pixel_format}")
    if video.colour_range == "full":
        words.append("colour range from full to limited")
    return tuple(words)


def _left_out(video: VideoFile) -> tuple[str, ...]:
    words = ["transparency left out"] if video.has_alpha else []
    if "audio" in video.other_streams:
        words.append("sound left out")
    if others := [kind for kind in video.other_streams if kind != "audio"]:
        words.append(f"{', '.join(others)} left out")
    return tuple(words)


# Pictures of a video through FFmpeg's filters into a clip, and how far the clip is from them.

CRF, PRESET = 12, "faster"
X264 = (
    "threads=1:lookahead-threads=1:sliced-threads=0:bframes=0:keyint=infinite:scenecut=0:"
    "colorprim=bt709:transfer=bt709:colormatrix=bt709:range=tv:cpu-independent=1:log-level=error"
)
"""As of clips that `stimuli build` makes: no B-frames, one group of pictures, BT.709 of limited range.

`cpu-independent` leaves out the macroblock tree's AVX-512 code, which reads memory that it never set: without
it one conversion in some 80 gave other bytes.
"""
LIMITED_RANGE = 1
PSNR_OF_LUMINANCE = "lavfi.psnr.psnr.y"


def encoder_signature() -> str:
    """Everything of the encoder that decides a clip's bytes."""
    codec = ".".join(str(part) for part in av.library_versions["libavcodec"])
    return f"libx264 via libavcodec {codec}; crf {CRF}; preset {PRESET}; {X264}"


def encode(source: Path, conversion: Conversion, target: Path) -> float | None:
    """Write `source` as a clip; return the lowest PSNR of a frame's luminance in dB, None where none differs.

    Raises
    ------
    NotAClip
        The pictures cannot be converted.
    """
    try:
        _write(source, conversion, target)
        return _lowest_psnr_db(source, conversion, target)
    except (FFmpegError, ValueError) as error:
        raise NotAClip(f"its pictures cannot be converted ({error}); {READ_AGAIN}") from error


def copy_pictures(source: Path, target: Path) -> None:
    """Write the encoded pictures of `source` as they are, and nothing else of the file."""
    with (
        open_container(source) as original,
        av.open(str(target), "w", format="mp4", options=_container()) as clip,
    ):
        stream = original.streams.video[0]
        copied = clip.add_stream_from_template(stream)
        for packet in original.demux(stream):
            if packet.dts is not None:
                packet.stream = copied
                clip.mux(packet)


def _container() -> dict[str, str]:
    return {"movflags": "+faststart", "fflags": "+bitexact"}


def _pictures(source: Path, conversion: Conversion) -> Iterator[Any]:
    """Each frame of the clip as it goes into the encoder, numbered from 0."""
    with open_container(source) as container:
        stream = container.streams.video[0]
        graph: Graph | None = None
        shown, at = conversion.frame_map, 0
        for number, frame in enumerate(container.decode(stream)):
            if graph is None:
                graph = _filters(frame, conversion.filters)
            if at >= len(shown) or shown[at] != number:
                continue
            frame.pts, frame.time_base = number, Fraction(1, 1000)
            graph.push(frame)
            picture: Any = graph.pull()
            while at < len(shown) and shown[at] == number:
                picture.pts, picture.time_base = at, 1 / conversion.rate
                yield picture
                at += 1


def _filters(frame: Any, filters: str) -> Graph:
    graph = Graph()
    source = graph.add_buffer(
        width=frame.width, height=frame.height, format=frame.format, time_base=Fraction(1, 1000)
    )
    previous = source
    for one in filters.split(","):
        name, _, arguments = one.partition("=")
        added = graph.add(name, arguments)
        previous.link_to(added)
        previous = added
    previous.link_to(graph.add("buffersink"))
    graph.configure()
    return graph


def _write(source: Path, conversion: Conversion, target: Path) -> None:
    with av.open(str(target), "w", format="mp4", options=_container()) as container:
        stream: Any = container.add_stream("libx264", rate=conversion.rate)
        stream.width, stream.height = conversion.size_px
        stream.pix_fmt = "yuv420p"
        stream.options = {"preset": PRESET, "profile": "high", "crf": str(CRF), "x264-params": X264}
        context = stream.codec_context
        context.thread_count, context.time_base = 1, 1 / conversion.rate
        context.color_range = LIMITED_RANGE
        context.colorspace = context.color_primaries = context.color_trc = BT709
        for picture in _pictures(source, conversion):
            picture.color_range, picture.colorspace = LIMITED_RANGE, BT709
            picture.pict_type = 0  # what kind of picture it was in the original is not kept
            container.mux(stream.encode(picture))
        container.mux(stream.encode(None))


def _lowest_psnr_db(source: Path, conversion: Conversion, target: Path) -> float | None:
    """The lowest PSNR of the clip's frames, each decoded and compared with the encoder's input."""
    compare, lowest = _Comparison(conversion), float("inf")
    with open_container(target) as container:
        decoded = container.decode(video=0)
        for picture, again in zip(_pictures(source, conversion), decoded, strict=True):
            lowest = min(lowest, compare.psnr_db(again, picture))
    return None if lowest == float("inf") else round(lowest, 2)


class _Comparison:
    """FFmpeg's psnr filter, fed with pairs of frames."""

    def __init__(self, conversion: Conversion) -> None:
        width, height = conversion.size_px
        graph = Graph()
        self.ends = [
            graph.add_buffer(
                width=width, height=height, format=VideoFormat("yuv420p"), time_base=Fraction(1, 1000)
            )
            for _ in range(2)
        ]
        psnr, self.sink = graph.add("psnr"), graph.add("buffersink")
        for pad, end in enumerate(self.ends):
            end.link_to(psnr, 0, pad)
        psnr.link_to(self.sink)
        graph.configure()
        self.graph, self.count = graph, 0

    def psnr_db(self, clip: Any, original: Any) -> float:
        """PSNR of the luminance of one pair, in dB; infinite if no pixel differs."""
        for end, frame in zip(self.ends, (clip, original), strict=True):
            frame.pts, frame.time_base = self.count, Fraction(1, 1000)
            end.push(frame)
        self.count += 1
        compared: Any = self.sink.pull()
        return float(compared.metadata[PSNR_OF_LUMINANCE])
