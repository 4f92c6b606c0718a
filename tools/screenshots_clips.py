"""Pictures of the characters and of a blink for docs/images.

Examples:
  python tools/screenshots_clips.py                            all characters, into docs/images

  python tools/screenshots_clips.py /tmp/sheets alder@8 hazel@5   two characters, elsewhere
"""

import argparse
import sys
from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from experiments.declaration.rendering import RenderSettings  # noqa: E402
from experiments.errors import InputError  # noqa: E402
from stimuli_builder.blinks.blink_model import default_model, textbook_profile  # noqa: E402
from stimuli_builder.blinks.profile import resample, to_full_closure  # noqa: E402
from stimuli_builder.characters.colour import linear_to_srgb  # noqa: E402
from stimuli_builder.clips.characters import find_character, geometry, shipped_names  # noqa: E402
from stimuli_builder.clips.curves import ClipCurve, Timing, clip_curve, frame_weights  # noqa: E402
from stimuli_builder.clips.exemplars import exemplar  # noqa: E402
from stimuli_builder.clips.face_movement import moved_levels  # noqa: E402
from stimuli_builder.clips.frames import FramePainter  # noqa: E402
from stimuli_builder.clips.geometry import Movement  # noqa: E402
from stimuli_builder.clips.kernels import FULL_SCALE  # noqa: E402
from stimuli_builder.clips.levels import LevelSet  # noqa: E402

SIZE = (960, 360)
CLOSURES = (0.0, 0.25, 0.5, 0.75, 1.0)
MOVED, LOWERED = "hazel@5", "alder@8"
"""Whose brow, cheek, squint and gaze are shown moved, and whose lower lid: one face each, for its size."""
FACES_IN_A_ROW = 6
QUALITY = 80
"""Of WebP: a quarter of a JPEG's size that looks alike. Every picture stays in the history of a clone."""
Rgb = NDArray[np.uint8]


def main() -> None:
    asked = arguments()
    folder: Path = asked.folder
    folder.mkdir(parents=True, exist_ok=True)
    for name in asked.names or shipped_names():
        whole = find_character(name).geometry.size_px
        tall = whole[1] > whole[0]
        character = find_character(name).levels(whole if tall else SIZE)
        save(closures_sheet(character, tall), folder / f"{name}-closures.webp")
        save(blink_sheet(character, tall), folder / f"{name}-blink.webp")
        if name == LOWERED:
            save(lower_lid_sheet(character), folder / f"{name}-lower-lid.webp")
        if name == MOVED:
            save(movement_sheet(character, name), folder / "face-movement.webp")
    if not asked.names:
        profile_curves(folder / "profiles.webp")


def arguments() -> argparse.Namespace:
    """Folder and names; a name that is none ends in one line before anything is drawn."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "folder", nargs="?", type=Path, default=ROOT / "docs" / "images", help="where to write (docs/images)"
    )
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help="characters, or their folders (all that ship)"
    )
    asked = parser.parse_args()
    try:
        for name in asked.names:
            find_character(name)
    except InputError as error:
        parser.error(str(error))
    return asked


def closures_sheet(character: LevelSet, tall: bool) -> Rgb:
    """Eyes one below the other at actual size; whole faces side by side at half of it."""
    if tall:
        return np.hstack([_reduced(character.picture(w), 2) for w in CLOSURES[::2]])
    return np.vstack([character.picture(w) for w in CLOSURES])


def lower_lid_sheet(character: LevelSet) -> Rgb:
    """The lower lid at rest, 1 mm up, 5 mm nasally and both: open at the left, half shut at the right."""
    columns = []
    for closure in (0.0, 0.5):
        rows = []
        for mm in ((0.0, 0.0), (1.0, 0.0), (0.0, 5.0), (1.0, 5.0)):
            up, nasal = (np.full(10, value) for value in mm)
            curve = ClipCurve(np.full(10, closure), 0, lower_vertical_mm=up, lower_horizontal_mm=nasal)
            light = character.base.astype(np.float32)
            light[character.window.slices] = FramePainter(character).light(
                curve, np.arange(10), np.full(10, 0.1)
            )
            picture = _reduced(linear_to_srgb(np.clip(light / np.float32(FULL_SCALE), 0, 1)), 2)
            rows.append(_titled(picture, f"closure {closure:g}, {mm[0]:g} mm up, {mm[1]:g} mm nasal"))
        columns.append(np.vstack(rows))
    return np.hstack(columns)


def movement_sheet(character: LevelSet, name: str) -> Rgb:
    """Brow, cheek, squint and gaze by the greatest amounts: without at the left, with at the right."""
    moved = moved_levels(character, geometry(name), Movement(brow=1.0, cheek=1.0, squint=1.0, gaze=1.0))
    columns = []
    for shown, title in (
        (character, "nothing declared"),
        (moved, "brow, cheek, squint and gaze 1 mm"),
    ):
        rows = [_reduced(shown.picture(closure), 2) for closure in (0.0, 0.5, 1.0)]
        columns.append(_titled(np.vstack(rows), title))
    return np.hstack(columns)


def blink_sheet(character: LevelSet, tall: bool) -> Rgb:
    """A model blink of 9 frames at 30 fps, without motion blur and with it, a third of actual size.

    Eyes one below the other, kinds side by side; whole faces in rows, the kinds one below the other.
    """
    kinds = []
    for blur, title in ((False, "NB: one sample a frame"), (True, "MB: mean of ten samples, linear light")):
        frames = blink_frames(character, blur)
        kinds.append(_titled(in_rows(frames, FACES_IN_A_ROW) if tall else np.vstack(frames), title))
    if tall:
        return np.vstack(kinds)
    return np.hstack([kinds[0], np.full((kinds[0].shape[0], 6, 3), 255, np.uint8), kinds[1]])


def blink_frames(character: LevelSet, blur: bool) -> list[Rgb]:
    """The blink's frames, a third of their size, from the second on."""
    shown = exemplar(RenderSettings(profile="model", duration_frames=9), "screenshot", 1, 2011)
    curve = clip_curve(shown.profile, Timing(2, 1, shown.phase_samples, 30), "none")
    painter, frames = FramePainter(character), []
    for row in frame_weights(len(curve.closure), 30, blur)[1:]:
        light = character.base.astype(np.float32)
        used = np.flatnonzero(row)
        light[character.window.slices] = painter.light(curve, used, row[used])
        frames.append(_reduced(linear_to_srgb(light / np.float32(FULL_SCALE)), 3))
    return frames


def in_rows(pictures: list[Rgb], columns: int) -> Rgb:
    """Pictures of one size from left to right and from top to bottom; white where the last row ends early."""
    blank = np.full_like(pictures[0], 255)
    filled = [*pictures, *[blank] * (-len(pictures) % columns)]
    return np.vstack([np.hstack(filled[k : k + columns]) for k in range(0, len(filled), columns)])


def profile_curves(path: Path) -> None:
    """The five profiles of Experiment 2 at 9 frames, as in the paper's Figure 8."""
    figure = Figure(figsize=(7.2, 3.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    model = default_model()
    mean = model.profile(np.zeros(model.coefficient_sd.size), "mean")
    if mean is None:
        raise SystemExit("the model's mean blink cannot be drawn")
    curves = {"model (mean)": to_full_closure(resample(mean, 9))}
    curves |= {
        kind.replace("_", " "): textbook_profile(kind, 9) for kind in ("AL_ease", "SL_ease", "AL", "SL")
    }
    for (label, profile), style in zip(curves.items(), ("-", "-", "--", "-", "--"), strict=True):
        time = np.arange(len(profile.closure)) / 10
        axes.plot(time, 1 - profile.closure, style, label=label, linewidth=2.4 if "model" in label else 1.4)
    axes.set(xlabel="frames at 30 fps", ylabel="opening (1 = open)", xlim=(0, 9), ylim=(-0.03, 1.03))
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, loc="lower right")
    drawn = BytesIO()
    figure.savefig(drawn, dpi=130)
    save(np.asarray(Image.open(drawn).convert("RGB")), path)


def save(picture: Rgb, path: Path) -> None:
    """Write a lossy WebP and say how large it is."""
    Image.fromarray(picture).save(path, "WEBP", quality=QUALITY, method=6)
    print(f"{path.name}: {path.stat().st_size // 1024} KiB")


def _reduced(picture: Rgb, times: int) -> Rgb:
    size = picture.shape[1] // times, picture.shape[0] // times
    return np.asarray(Image.fromarray(picture).resize(size, Image.Resampling.LANCZOS))


def _titled(picture: Rgb, title: str) -> Rgb:
    image = Image.new("RGB", (picture.shape[1], picture.shape[0] + 22), "white")
    image.paste(Image.fromarray(picture), (0, 22))
    ImageDraw.Draw(image).text((4, 3), title, fill="black", font=ImageFont.load_default(14))
    return np.asarray(image)


if __name__ == "__main__":
    main()
