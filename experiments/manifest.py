"""The `manifest.json` in a folder of clips: what each clip shows, and the hash of its bytes."""

import hashlib
import json
from pathlib import Path, PurePosixPath
from typing import Annotated, Literal

from pydantic import Field, StringConstraints, ValidationError

from experiments.checks import CheckName
from experiments.declaration.base import Declaration
from experiments.errors import InputError, wrong_value

# What a converted clip was made from: the original, and the changes.

ColourRange = Literal["limited", "full", "not said"]
"""Limited: luminance 16 to 235 of 255, as in video. Full: 0 to 255. Not said: treated as limited."""
FrameRate = Annotated[float, Field(ge=1, le=240)]


class SourceVideo(Declaration):
    """The original of a converted clip, and what the conversion did.

    Attributes
    ----------
    file : str
        The name it came with.
    sha256 : str
        Of its bytes. The original is kept.
    bytes : int
        Length of the file.
    container, codec, pixel_format : str
        As FFmpeg calls them.
    colour_range : str
        Of the original; clips are always of limited range.
    width_px, height_px : int
        Of its stored frames, before rotation.
    fps : float
        Frames per second; with a variable rate, the inverse of the median time between frames.
    variable_rate : bool
        True if its frames are not equally spaced in time.
    frames : int
        Frames of the original.
    changes : tuple of str
        The changes, in words, in the order in which they were made.
    encoded_again : bool
        False if its frames were copied unchanged.
    frame_map : tuple of int
        For each frame of the clip, the frame of the original that it shows, both from 0; empty if they are
        identical.
    lowest_psnr_db : float or None
        Peak signal-to-noise ratio of the luminance of the clip's worst frame, between the encoder's input and
        output; None if no pixel differs or nothing was re-encoded.
    encoder : str
        Name of the encoder; empty if nothing was re-encoded.
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
        """Name of the original in the folder of a manifest; the converted clip may have its name."""
        pure = PurePosixPath(self.file)
        return f"{pure.stem}.original{pure.suffix}"


MANIFEST_NAME = "manifest.json"
MADE_ELSEWHERE = "clips made elsewhere"
"""The note in a manifest that `stimuli manifest` wrote for your own clips."""
UPLOADED = "uploaded"
"""Used instead of a program version for clips that were uploaded on the admin site."""
Sha256 = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{64}$")]
FileName = Annotated[str, StringConstraints(pattern=r"^\w[^/\\\x00-\x1f\x7f]{0,150}$")]
"""A file name in any script: it starts with a letter or digit, has no slash, and at most 151 characters."""


class Clip(Declaration):
    """One rendered clip.

    Attributes
    ----------
    levels, cell, exemplar : dict of str to str, str, int
        Its place in the design.
    profile : str
        Identifier of the blink shown.
    profile_repeated : bool
        True if the same recorded eye is already used for another exemplar of this cell.
    closure : tuple of float
        Closure at 300 fps over the whole clip (0 open, 1 closed); empty for clips not made here.
    closure_other : tuple of float
        Closure of the right eye, if the eyes move separately.
    lower_vertical_mm, lower_horizontal_mm : tuple of float
        Lift of the lower lid and its slide toward the nose, at 300 fps; empty if it rests.
    blinks_s : tuple of float
        Onsets of the blinks of a performance, in s from the start of the clip; omitted for other clips.
    onset_frame : int or None
        Output frame at which the blink begins.
    width_mm : float or None
        Shown width at actual size.
    source : SourceVideo or None
        What a converted clip was made from; omitted if the file is shown unchanged.
    """

    levels: dict[str, str]
    cell: str
    exemplar: Annotated[int, Field(ge=1)]
    file: FileName
    sha256: Sha256
    bytes: Annotated[int, Field(gt=0)]
    fps: Annotated[float, Field(gt=0)]
    frames: Annotated[int, Field(gt=0)]
    width_px: Annotated[int, Field(gt=0)]
    height_px: Annotated[int, Field(gt=0)]
    width_mm: Annotated[float, Field(gt=0)] | None = None
    profile: str = ""
    profile_repeated: bool = False
    duration_frames: float | None = None
    onset_frame: int | None = None
    closure: tuple[float, ...] = ()
    closure_other: tuple[float, ...] = ()
    lower_vertical_mm: tuple[float, ...] = ()
    lower_horizontal_mm: tuple[float, ...] = ()
    blinks_s: tuple[float, ...] = Field(default=(), exclude_if=lambda blinks: not blinks)
    inputs: dict[str, str] = Field(default_factory=dict)
    seed: int | None = None
    source: SourceVideo | None = Field(default=None, exclude_if=lambda source: source is None)


class CheckClip(Declaration):
    """One clip of a motion check. Its file name reveals nothing about the answer, and participants never see
    it.

    Attributes
    ----------
    check : {"digit", "direction", "shape", "first_blink", "first_eye"}
        Kind of check.
    number : int
        Of the check, from 1.
    answer : int
        Number of the right choice, from 1.
    width_mm : float or None
        Shown width at actual size.
    """

    check: CheckName
    number: Annotated[int, Field(ge=1)]
    answer: Annotated[int, Field(ge=1)]
    file: FileName
    sha256: Sha256
    bytes: Annotated[int, Field(gt=0)]
    fps: Annotated[float, Field(gt=0)]
    frames: Annotated[int, Field(gt=0)]
    width_px: Annotated[int, Field(gt=0)]
    height_px: Annotated[int, Field(gt=0)]
    width_mm: Annotated[float, Field(gt=0)] | None = None
    inputs: dict[str, str] = Field(default_factory=dict)


class Manifest(Declaration):
    """All clips of one experiment, and how they were made.

    Attributes
    ----------
    checks : tuple of CheckClip
        Clips of motion checks.
    checks_seed : int or None
        Their random seed; it reveals their answers, so keep it secret.
    """

    experiment: str
    definition_sha256: Sha256
    program_version: str
    seed: int
    inter_ocular_px: float | None = None
    notes: tuple[str, ...] = ()
    clips: Annotated[tuple[Clip, ...], Field(min_length=1)]
    checks_seed: int | None = None
    checks: tuple[CheckClip, ...] = ()

    @property
    def files(self) -> tuple[Clip | CheckClip, ...]:
        """Every clip that has a file: clips of the design and of checks."""
        return (*self.clips, *self.checks)

    @property
    def made_elsewhere(self) -> bool:
        """Whether `stimuli manifest` wrote it for your own clips."""
        return MADE_ELSEWHERE in self.notes

    @property
    def sources(self) -> tuple[SourceVideo, ...]:
        """The originals of clips that were converted."""
        return tuple(clip.source for clip in self.clips if clip.source is not None)


def read_manifest(folder: Path) -> Manifest:
    """Read and validate `folder/manifest.json`; one-line InputError if it cannot be used."""
    path = folder / MANIFEST_NAME
    if not path.is_file():
        raise InputError(
            f"expected a {MANIFEST_NAME} in {folder}, found none; build the clips with `stimuli build`, or "
            f"write a manifest for your own clips with `stimuli manifest`"
        )
    try:
        return Manifest.model_validate(json.loads(path.read_text(encoding="utf-8")))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path} is not valid JSON ({error}); build the clips again") from error
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        raise InputError(f"{path}: {key}: {wrong_value(first)}; build the clips again") from error


def check_files(manifest: Manifest, folder: Path) -> None:
    """Raise InputError for the first clip that is missing or whose hash differs."""
    for clip in manifest.files:
        path = folder / clip.file
        if not path.is_file():
            raise InputError(
                f"clip {clip.file} ({place_of(clip)}) is missing from {folder}; {_remedy(manifest)}"
            )
        digest = file_sha256(path)
        if digest != clip.sha256:
            raise InputError(
                f"clip {clip.file}: expected sha256 {clip.sha256[:12]}..., got {digest[:12]}...; "
                f"the file was changed or damaged; {_remedy(manifest)}"
            )


def _remedy(manifest: Manifest) -> str:
    """How to restore a clip, depending on its origin."""
    if manifest.made_elsewhere:
        return "restore the file, or write the manifest again with `stimuli manifest`"
    return "build the clips again with `stimuli build`"


def check_originals(manifest: Manifest, folder: Path) -> None:
    """Raise InputError for the first original of a converted clip that is missing or was changed."""
    for source in manifest.sources:
        path = folder / source.kept_as
        if not path.is_file() or file_sha256(path) != source.sha256:
            state = "was changed" if path.is_file() else "is missing"
            raise InputError(
                f"original {source.kept_as}, from which a clip was converted, {state} in {folder}; write "
                f"the manifest again with `stimuli manifest`, which restores it"
            )


def place_of(clip: Clip | CheckClip) -> str:
    """The place of a clip in the study, in words."""
    return f"check {clip.number}" if isinstance(clip, CheckClip) else f"{clip.cell}, exemplar {clip.exemplar}"


def file_sha256(path: Path) -> str:
    """SHA-256 of a file's bytes as 64 hexadecimal digits."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
