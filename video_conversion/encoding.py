"""Pictures of a video through FFmpeg's filters into a clip, and how far the clip is from them."""

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
from av.error import FFmpegError
from av.filter import Graph
from av.video.format import VideoFormat

from video_conversion.conversion import Conversion
from video_conversion.video_file import READ_AGAIN, NotAClip, opened

CRF, PRESET = 12, "faster"
X264 = (
    "threads=1:lookahead-threads=1:sliced-threads=0:bframes=0:keyint=infinite:scenecut=0:"
    "colorprim=bt709:transfer=bt709:colormatrix=bt709:range=tv:log-level=error"
)
"""As of clips that `stimuli build` makes: no B-frames, one group of pictures, BT.709 of limited range."""
BT709, LIMITED_RANGE = 1, 1
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
    with opened(source) as original, av.open(str(target), "w", format="mp4", options=_container()) as clip:
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
    with opened(source) as container:
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
    """Of the clip's frames, each decoded again and compared with what went into the encoder."""
    compare, lowest = _Comparison(conversion), float("inf")
    with opened(target) as container:
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
        """Of the luminance of one pair, in dB; infinite where no pixel differs."""
        for end, frame in zip(self.ends, (clip, original), strict=True):
            frame.pts, frame.time_base = self.count, Fraction(1, 1000)
            end.push(frame)
        self.count += 1
        compared: Any = self.sink.pull()
        return float(compared.metadata[PSNR_OF_LUMINANCE])
