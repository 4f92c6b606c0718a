"""Pictures of the characters and of a blink for docs/images: `python tools/screenshots_clips.py [FOLDER]`."""

import sys
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from experiments.rendering import RenderSettings  # noqa: E402
from stimuli_builder.blinks.blink_model import default_model  # noqa: E402
from stimuli_builder.blinks.profile import resample, to_full_closure  # noqa: E402
from stimuli_builder.blinks.textbook import textbook_profile  # noqa: E402
from stimuli_builder.characters.colour import linear_to_srgb  # noqa: E402
from stimuli_builder.clips.characters import find_character, shipped_names  # noqa: E402
from stimuli_builder.clips.curves import Timing, clip_curve  # noqa: E402
from stimuli_builder.clips.exemplars import exemplar  # noqa: E402
from stimuli_builder.clips.frames import FramePainter  # noqa: E402
from stimuli_builder.clips.kernels import FULL_SCALE  # noqa: E402
from stimuli_builder.clips.levels import LevelSet  # noqa: E402
from stimuli_builder.clips.motion_blur import frame_weights  # noqa: E402

SIZE = (960, 360)
CLOSURES = (0.0, 0.25, 0.5, 0.75, 1.0)
LIMIT_BYTES = 400_000
Rgb = NDArray[np.uint8]


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "images"
    folder.mkdir(parents=True, exist_ok=True)
    for name in shipped_names():
        character = find_character(name).levels(SIZE)
        levels = np.vstack([character.picture(w) for w in CLOSURES])
        save(levels, folder / f"{name}-closures.jpg")
        save(blink_sheet(character), folder / f"{name}-blink.jpg")
    profile_curves(folder / "profiles.png")


def blink_sheet(character: LevelSet) -> Rgb:
    """A model blink of 9 frames at 30 fps: without motion blur at the left, with it at the right."""
    shown = exemplar(RenderSettings(profile="model", duration_frames=9), "screenshot", 1, 2011)
    curve = clip_curve(shown.profile, Timing(2, 1, shown.phase_samples, 30), "none")
    painter = FramePainter(character)
    columns = []
    for blur, title in ((False, "NB: one sample a frame"), (True, "MB: mean of ten samples, linear light")):
        rows = []
        for row in frame_weights(len(curve.closure), 30, blur)[1:]:
            light = character.base.astype(np.float32)
            used = np.flatnonzero(row)
            light[character.window.slices] = painter.light(curve, used, row[used])
            rows.append(_reduced(linear_to_srgb(light / np.float32(FULL_SCALE)), 3))
        columns.append(_titled(np.vstack(rows), title))
    return np.hstack([columns[0], np.full((columns[0].shape[0], 6, 3), 255, np.uint8), columns[1]])


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
    figure.savefig(path, dpi=130, metadata={"Software": None})
    print(f"{path.name}: {path.stat().st_size // 1024} KiB")


def save(picture: Rgb, path: Path) -> None:
    """Write a JPEG without chroma subsampling, at the best quality that stays under the limit."""
    for quality in (94, 90, 86, 80, 72, 60):
        Image.fromarray(picture).save(path, "JPEG", quality=quality, subsampling=0, optimize=True)
        if path.stat().st_size <= LIMIT_BYTES:
            break
    print(f"{path.name}: {path.stat().st_size // 1024} KiB, quality {quality}")


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
