"""What became of one video: the clip that it is now, or why it cannot be one."""

from pathlib import Path, PurePosixPath

from pydantic import BaseModel, ConfigDict

from experiments.manifest import FrameRate, SourceVideo

VIDEO_ENDINGS = (
    ".mp4", ".m4v", ".mov", ".webm", ".mkv", ".avi", ".mpg", ".mpeg", ".m2v", ".ts", ".mts", ".m2ts", ".wmv",
    ".flv", ".gif", ".apng", ".ogv", ".3gp", ".mxf", ".y4m",
)  # fmt: skip
QUICKTIME = "qt  "
"""The brand of files that the participant page does not read."""


class Prepared(BaseModel):
    """One video of an upload: the clip that it became, or why it cannot be one.

    Attributes
    ----------
    name : str
        The file as it was sent.
    asked_fps : float or None
        Frames per second that were asked for then.
    problem : str or None
        Why there is no clip, and what to do.
    clip : str
        The clip's file within the upload's folder; the file itself where it is shown as it came.
    source : SourceVideo or None
        What the clip was made from; None where it is the file itself.
    replaced : bool
        Nothing is known of this file any longer: another has taken its place.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    asked_fps: FrameRate | None
    problem: str | None = None
    clip: str = ""
    sha256: str = ""
    bytes: int = 0
    fps: float = 0.0
    frames: int = 0
    width_px: int = 0
    height_px: int = 0
    source: SourceVideo | None = None
    replaced: bool = False


def clip_name(name: str) -> str:
    """What the clip made of this file is called: clips are MP4 files."""
    pure = PurePosixPath(name)
    return name if pure.suffix.lower() in (".mp4", ".m4v", ".mov") else f"{pure.stem}.mp4"


def major_brand(path: Path) -> str:
    """The major brand of a file that begins with it, as the participant page's reader expects it."""
    with path.open("rb") as stream:
        begin = stream.read(12)
    return begin[8:12].decode("latin-1") if begin[4:8] == b"ftyp" else ""
