"""What a clip was made from, where it is not shown as it came: the original, and what was changed."""

from pathlib import PurePosixPath
from typing import Annotated, Literal

from pydantic import Field, StringConstraints

from experiments.base import Declaration

ColourRange = Literal["limited", "full", "not said"]
"""Limited: luminance 16 to 235 of 255, as video has it; full: 0 to 255; not said: taken as limited."""
FrameRate = Annotated[float, Field(ge=1, le=240)]


class SourceVideo(Declaration):
    """The original of a converted clip, and what the conversion did.

    Attributes
    ----------
    file : str
        The name it came with.
    sha256 : str
        Of its bytes, which are kept.
    bytes : int
        Length of the file.
    container, codec, pixel_format : str
        As FFmpeg calls them.
    colour_range : str
        Of the original; clips are always of limited range.
    width_px, height_px : int
        Of its stored pictures, before they were turned.
    fps : float
        Frames per second; of a variable rate, the inverse of the median time between frames.
    variable_rate : bool
        True where its frames do not follow one another at equal times.
    frames : int
        Frames of the original.
    changes : tuple of str
        What was done, in words, in the order in which it was done.
    encoded_again : bool
        False where its pictures were copied as they were.
    frame_map : tuple of int
        For each frame of the clip the frame of the original that it shows, both from 0; empty where each
        shows its own.
    lowest_psnr_db : float or None
        Of the clip's worst frame: peak signal-to-noise ratio of the luminance, between what went into the
        encoder and what comes out of it; None where no pixel differs or nothing was encoded again.
    encoder : str
        What encoded it; empty where nothing was encoded again.
    """

    file: Annotated[str, StringConstraints(min_length=1, max_length=200)]
    sha256: Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{64}$")]
    bytes: Annotated[int, Field(gt=0)]
    container: str
    codec: str
    pixel_format: str
    colour_range: ColourRange
    width_px: Annotated[int, Field(gt=0)]
    height_px: Annotated[int, Field(gt=0)]
    fps: Annotated[float, Field(gt=0)]
    variable_rate: bool
    frames: Annotated[int, Field(gt=0)]
    changes: Annotated[tuple[str, ...], Field(min_length=1)]
    encoded_again: bool
    frame_map: tuple[int, ...] = ()
    lowest_psnr_db: float | None = None
    encoder: str = ""

    @property
    def kept_as(self) -> str:
        """The original's name in the folder of a manifest: the clip made from it may have its name."""
        pure = PurePosixPath(self.file)
        return f"{pure.stem}.original{pure.suffix}"
