"""`stimuli clip`: one clip, without an experiment."""

import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from experiments.errors import InputError

if TYPE_CHECKING:
    from experiments.declaration.rendering import RenderSettings

CLIP_HELP = """
Render one clip from a blink profile and a character.

PROFILE is real (a recorded blink), model (sampled from the model of recorded blinks), a textbook curve, the
name of a shipped recording (`stimuli profiles`), or a CSV file of closure samples at 300 fps (0 open, 1
closed). Textbook curves move at constant speed: SL is symmetric, AL closes faster than it opens; SL_ease and
AL_ease start and end slowly.

Examples:

  stimuli clip --profile real --character alder@8 --out blink.mp4

  stimuli clip --profile AL_ease --duration 9 --character cartoon --no-blur --out textbook.mp4

  stimuli clip --character hazel@7 --brow-mm 0.25 --cheek-mm 0.3 --squint-mm 0.2 --gaze-mm 0.4 --out moved.mp4

  stimuli clip --character alder@8 --life 1 --clip-frames 150 --out alive.mp4

  stimuli clip --profile mine.csv --character my_renders/ --size 1920x720 --fps 60 --out big.mp4
"""
OPTIONS = {
    "duration_frames": "--duration",
    "duration_ms": "--duration-ms",
    "brow_mm": "--brow-mm",
    "cheek_mm": "--cheek-mm",
    "squint_mm": "--squint-mm",
    "gaze_mm": "--gaze-mm",
    "width_px": "--size (width)",
    "height_px": "--size (height)",
}
"""Keys of a declaration's [render], and the options that stand for them here."""
Amplitude = Literal["full", "natural"]
LowerLid = Literal["both", "vertical", "horizontal", "none"]
Eyes = Literal["alike", "separate"]


def clip_command(
    out: Annotated[Path, typer.Option(help="MP4 file to write.")],
    profile: Annotated[str, typer.Option(help="Blink to show (see above).")] = "model",
    character: Annotated[
        str, typer.Option(help="A shipped character (`stimuli character list`) or a character folder.")
    ] = "cartoon",
    duration: Annotated[float | None, typer.Option(help="Blink length in frames at 30 fps.")] = None,
    duration_ms: Annotated[
        float | None, typer.Option(help=("Blink length in ms, instead of --duration."))
    ] = None,
    amplitude: Annotated[
        Amplitude, typer.Option(help="full: the eye closes completely (FC); natural: as measured (NC).")
    ] = "full",
    blur: Annotated[bool, typer.Option("--blur/--no-blur", help="Motion blur (MB) or none (NB).")] = True,
    lower_lid: Annotated[LowerLid, typer.Option(help="Lower-lid signals that move.")] = "none",
    brow_mm: Annotated[
        float | None, typer.Option(help=("How far the brows move down while the eye closes, in mm."))
    ] = None,
    cheek_mm: Annotated[float | None, typer.Option(help="How far the cheeks rise, in mm.")] = None,
    squint_mm: Annotated[
        float | None,
        typer.Option(help=("How far the skin below the eye moves up and toward the nose, in mm.")),
    ] = None,
    gaze_mm: Annotated[
        float | None, typer.Option(help=("How far the iris turns down under the lid, in mm."))
    ] = None,
    life: Annotated[
        float, typer.Option(min=0, max=1, help="Motion between blinks: 0 none, 1 as in recordings of people.")
    ] = 0.0,
    anticipation: Annotated[
        float, typer.Option(min=0, max=1, help="How far the lids lift before the blink: 1 is 8%.")
    ] = 0.0,
    settle: Annotated[
        float, typer.Option(min=0, max=1, help="How far the lids open beyond rest after the blink: 1 is 8%.")
    ] = 0.0,
    eyes: Annotated[
        Eyes, typer.Option(help="One signal for both eyes, or the recorded left and right eye.")
    ] = "alike",
    exemplar: Annotated[int, typer.Option(min=1, help="Which blink of this profile, by number.")] = 1,
    seed: Annotated[int, typer.Option(help="Random seed for all choices.")] = 2011,
    fps: Annotated[int, typer.Option(min=24, max=60, help="Frame rate.")] = 30,
    size: Annotated[
        str | None,
        typer.Option(help="Width x height in px, at most 1920x1200 [default: the character's own size]."),
    ] = None,
    clip_frames: Annotated[
        int | None, typer.Option(min=1, max=5_000, help="Length of the clip in frames.")
    ] = None,
    barcode: Annotated[bool, typer.Option("--test-barcode", help="Draw each frame's number.")] = False,
) -> None:
    """Render one clip."""
    from stimuli_builder.clips.characters import geometry
    from stimuli_builder.clips.design_clips import SingleClip, render_single
    from stimuli_builder.clips.exemplars import reading_note

    if out.suffix.lower() != ".mp4":
        raise InputError(f"--out: expected a name ending in .mp4, got '{out.name}'; clips are H.264 in MP4")
    width, height = geometry(character).clip_size_px() if size is None else parse_size(size)
    settings = settings_from(
        character=character,
        profile=profile if profile.endswith(".csv") else "real",
        duration_frames=duration,
        duration_ms=duration_ms,
        amplitude=amplitude,
        motion_blur=blur,
        lower_lid=lower_lid,
        brow_mm=brow_mm,
        cheek_mm=cheek_mm,
        squint_mm=squint_mm,
        gaze_mm=gaze_mm,
        life=life,
        anticipation=anticipation,
        settle=settle,
        eyes=eyes,
        fps=fps,
        width_px=width,
        height_px=height,
    )
    if profile.endswith(".csv") and (note := reading_note(Path(profile))):
        sys.stderr.write(f"note: {note}\n")
    clip = SingleClip(settings, profile, exemplar, seed, clip_frames, barcode)
    made = render_single(clip, out)
    # Only a recorded blink has a name that says more than the option; others would be their parameters.
    name = made.curve.profile_id if profile == "real" else profile
    print(
        f"wrote {out}: {made.frames} frames at {fps} fps; profile {name}; the blink begins at frame "
        f"{made.onset_frame} and lasts {made.curve.duration_frames / 0.03:.0f} ms"
    )


def parse_size(text: str) -> tuple[int, int]:
    """(width, height) of `960x360`."""
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(part.strip().isdigit() for part in parts):
        raise InputError(f"--size: expected WIDTHxHEIGHT such as 960x360, got '{text}'")
    return int(parts[0]), int(parts[1])


def settings_from(**values: object) -> "RenderSettings":
    """Make settings; a value out of range ends in one line that names the option."""
    from pydantic import ValidationError

    from experiments.declaration.rendering import RenderSettings
    from experiments.errors import wrong_value

    try:
        return RenderSettings.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        option = f"{_option(str(first['loc'][-1]))}: " if first["loc"] else ""
        words = re.sub(r"\w+", lambda key: _option(key[0]), wrong_value(first))
        raise InputError(option + words) from error


def _option(key: str) -> str:
    return OPTIONS.get(key, key)
