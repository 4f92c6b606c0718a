"""One video looked into, and its clip made where it cannot be shown as it is."""

import os
from pathlib import Path

from experiments.files import temporary_beside
from experiments.manifest import SourceVideo, file_sha256
from video_conversion.conversion import Conversion, conversion_of, copy_pictures, encode, encoder_signature
from video_conversion.prepared import Prepared
from video_conversion.video_file import READ_AGAIN, NotAClip, VideoFile, examine


def prepare(path: Path, clips: Path, asked_fps: float | None) -> Prepared:
    """Look into one video and make its clip where it cannot be shown as it is.

    Parameters
    ----------
    path : Path
        The video.
    clips : Path
        Folder of made clips; the clip gets its hash as name.
    asked_fps : float or None
        Frames per second of the clip; None: the video's own.

    Raises
    ------
    NotAClip
        It cannot become one.
    """
    video = examine(path)
    conversion = conversion_of(video, asked_fps)
    if not conversion.changes:
        return _record(path, path, path.name, conversion, asked_fps, None)
    temporary = temporary_beside(clips / "clip.mp4", ".mp4")
    try:
        psnr_db = encode(path, conversion, temporary) if conversion.encodes else None
        if not conversion.encodes:
            copy_pictures(path, temporary)
        _check_shown(temporary, conversion)
        made = clips / f"{file_sha256(temporary)}.mp4"
        temporary.replace(made)
    finally:
        temporary.unlink(missing_ok=True)
    source = _source(path, video, conversion, psnr_db)
    return _record(path, made, f"{clips.name}/{made.name}", conversion, asked_fps, source)


def _check_shown(clip: Path, conversion: Conversion) -> None:
    """NotAClip unless what was written needs no further change and has every frame."""
    made = examine(clip)
    if len(made.times_s) != len(conversion.frame_map) or conversion_of(made, None).changes:
        raise NotAClip(f"it could not be converted without loss of frames; {READ_AGAIN}")


def _source(path: Path, video: VideoFile, conversion: Conversion, psnr_db: float | None) -> SourceVideo:
    own = conversion.frame_map == tuple(range(len(video.times_s)))
    return SourceVideo(
        file=path.name,
        sha256=file_sha256(path),
        bytes=path.stat().st_size,
        container=video.container,
        codec=video.codec,
        pixel_format=video.pixel_format,
        colour_range=video.colour_range,
        width_px=video.width_px,
        height_px=video.height_px,
        fps=float(video.typical_rate),
        variable_rate=video.rate is None,
        frames=len(video.times_s),
        changes=conversion.changes,
        encoded_again=conversion.encodes,
        frame_map=() if own else conversion.frame_map,
        lowest_psnr_db=psnr_db,
        encoder=encoder_signature() if conversion.encodes else "",
    )


def _record(
    path: Path,
    clip: Path,
    clip_name: str,
    conversion: Conversion,
    asked_fps: float | None,
    source: SourceVideo | None,
) -> Prepared:
    _settle(clip)
    return Prepared(
        name=path.name,
        asked_fps=asked_fps,
        clip=clip_name,
        sha256=file_sha256(clip),
        bytes=clip.stat().st_size,
        fps=float(conversion.rate),
        frames=len(conversion.frame_map),
        width_px=conversion.size_px[0],
        height_px=conversion.size_px[1],
        source=source,
    )


def _settle(path: Path) -> None:
    """Wait until the file is on the disk: the clip store links to it."""
    with path.open("rb") as stream:
        os.fsync(stream.fileno())
