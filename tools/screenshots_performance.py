"""Picture of a 20 s performance for docs/images, frame by frame around three blinks, by both characters.

python tools/screenshots_performance.py [FOLDER]
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from experiments.declaration.rendering import RenderSettings  # noqa: E402
from stimuli_builder.characters.colour import linear_to_srgb  # noqa: E402
from stimuli_builder.clips.characters import find_character, shipped_names  # noqa: E402
from stimuli_builder.clips.curves import ClipCurve, frame_windows  # noqa: E402
from stimuli_builder.clips.design_clips import performance_curve  # noqa: E402
from stimuli_builder.clips.frames import FramePainter  # noqa: E402
from stimuli_builder.clips.kernels import FULL_SCALE  # noqa: E402
from tools.screenshots_clips import SIZE, Rgb, save  # noqa: E402

FPS, SEED, EXEMPLAR = 30, 2011, 5
COLUMNS, CELL_PX = 11, (160, 60)
CHOSEN = (0, 1, -2)
"""The first, the second and the last but one blink."""
SETTINGS = RenderSettings(
    performance="intervals", seconds=20, state="listening", amplitude="natural", eyes="separate"
)


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "images"
    curve = performance_curve(SETTINGS, "", EXEMPLAR, SEED)
    print("blinks at", ", ".join(f"{one:.2f}" for one in curve.blinks_s), "s")
    starts = [int(FPS * curve.blinks_s[index]) for index in CHOSEN]
    characters = [name for name in ("alder@8", "cartoon") if name in shipped_names()]
    painters = [FramePainter(find_character(name).levels(SIZE)) for name in characters]
    rows = []
    for start in starts:
        rows.append(numbered(range(start, start + COLUMNS)))
        rows += [strip(painter, curve, start) for painter in painters]
    save(np.vstack(rows), folder / "performance-blinks.webp")


def strip(painter: FramePainter, curve: ClipCurve, start: int) -> Rgb:
    """One character's frames from `start` on, beside one another."""
    windows = list(frame_windows(len(curve.closure), FPS, True))
    cells = []
    for samples, weights in windows[start : start + COLUMNS]:
        light = painter.character.base.astype(np.float32)
        light[painter.character.window.slices] = painter.light(curve, samples, weights)
        picture = Image.fromarray(linear_to_srgb(light / np.float32(FULL_SCALE)))
        cells.append(np.asarray(picture.resize(CELL_PX, Image.Resampling.LANCZOS)))
    return np.hstack(cells)


def numbered(frames: range) -> Rgb:
    """A line with the numbers of the frames."""
    line = Image.new("RGB", (CELL_PX[0] * COLUMNS, 18), "white")
    draw, font = ImageDraw.Draw(line), ImageFont.load_default(12)
    for index, frame in enumerate(frames):
        draw.text((CELL_PX[0] * index + 4, 2), str(frame), fill="black", font=font)
    return np.asarray(line)


if __name__ == "__main__":
    main()
