"""What a folder of clips looks like: a contact sheet (PNG) and a page that plays every clip."""

import json
from collections.abc import Sequence
from functools import partial
from io import BytesIO
from itertools import accumulate, groupby
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
from jinja2 import Environment, PackageLoader
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont, ImageOps

from experiments.files import whole_file, whole_text
from experiments.manifest import Clip, Manifest
from stimuli_builder.characters.declaration import write_bytes
from stimuli_builder.clips.characters import find_character, geometry, shipped_names
from stimuli_builder.clips.curves import samples_per_frame
from stimuli_builder.video import decode

Rgb = NDArray[np.uint8]
THUMBNAIL_PX = (200, 160)
"""Box that a frame on the sheet lies in: eyes are as wide as it, a whole face as high."""
LABEL_PX = 230
LABEL_HEIGHT_PX = 75
PAPER, INK = (245, 244, 241), (40, 38, 36)
PAGE_NAME, SHEET_NAME = "preview.html", "preview.png"


def write_preview(manifest: Manifest, folder: Path) -> tuple[Path, Path]:
    """Write `preview.png` and `preview.html` to the folder of the clips; returns their paths."""
    sheet, page = folder / SHEET_NAME, folder / PAGE_NAME
    picture = Image.fromarray(contact_sheet(manifest, folder))
    with whole_file(sheet) as temporary:
        picture.save(temporary, "PNG", optimize=True)
    with whole_text(page) as stream:
        stream.write(page_text(manifest))
    return sheet, page


def contact_sheet(manifest: Manifest, folder: Path) -> Rgb:
    """One row per cell: the blink of its first exemplar, frame by frame."""
    firsts = [next(clips) for _, clips in groupby(manifest.clips, key=lambda clip: clip.cell)]
    rows = [[thumbnail(frame) for frame in blink_frames(folder / clip.file, clip)] for clip in firsts]
    columns, width = max(map(len, rows)), max(frame.width for frames in rows for frame in frames)
    heights = [max(LABEL_HEIGHT_PX, *(frame.height for frame in frames)) + 2 for frames in rows]
    sheet = Image.new("RGB", (LABEL_PX + columns * (width + 2), sum(heights)), PAPER)
    draw = ImageDraw.Draw(sheet)
    font = ImageFont.load_default(15)
    tops = [0, *accumulate(heights)]
    for top, clip, frames in zip(tops[:-1], firsts, rows, strict=True):
        draw.multiline_text((8, top + 10), _label(clip), fill=INK, font=font, spacing=4)
        for column, frame in enumerate(frames):
            sheet.paste(frame, (LABEL_PX + column * (width + 2), top))
    return np.asarray(sheet)


def thumbnail(frame: Rgb) -> Image.Image:
    """A frame as the sheet shows it: smaller, in its own proportions."""
    return ImageOps.contain(Image.fromarray(frame), THUMBNAIL_PX, Image.Resampling.LANCZOS)


def blink_frames(path: Path, clip: Clip) -> list[Rgb]:
    """The frames of a clip from the one before the blink to the one after it."""
    start = max((clip.onset_frame or 0) - 1, 0)
    length = (clip.duration_frames or 0) * clip.fps / 30
    stop = start + int(np.ceil(length)) + 3
    with av.open(str(path)) as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    return frames[start:stop]


def _label(clip: Clip) -> str:
    length = f"{clip.duration_frames:g} frames" if clip.duration_frames else ""
    return f"{clip.cell}\n{clip.profile}\n{length}"


def page_text(manifest: Manifest) -> str:
    """The page; it plays the files in its folder and needs nothing else."""
    environment = Environment(loader=PackageLoader("stimuli_builder.clips", "templates"), autoescape=True)
    # Inside a script element only "</" could end it early.
    encoded = partial(json.dumps, ensure_ascii=True, separators=(",", ":"))
    signals = [value for c in manifest.clips for value in (*c.lower_vertical_mm, *c.lower_horizontal_mm)]
    lower_mm = int(np.ceil(max(signals, default=0.0)))
    data = encoded([_clip_data(clip, lower_mm or 1) for clip in manifest.clips]).replace("</", "<\\/")
    factors = {
        name: sorted({clip.levels[name] for clip in manifest.clips}) for name in manifest.clips[0].levels
    }
    template = environment.get_template("preview.html.j2")
    apart = any(clip.closure_other for clip in manifest.clips)
    return template.render(manifest=manifest, factors=factors, data=data, apart=apart, lower_mm=lower_mm)


def _clip_data(clip: Clip, lower_mm: float) -> dict[str, Any]:
    """What the page needs of a clip; signals in 0-1, the lower lid's as shares of `lower_mm`."""
    step = max(1, round(samples_per_frame(clip.fps) / 5))

    def thinned(values: tuple[float, ...], full: float = 1.0) -> list[float]:
        return [round(value / full, 3) for value in values[::step]]

    return {
        "file": clip.file,
        "levels": clip.levels,
        "cell": clip.cell,
        "exemplar": clip.exemplar,
        "profile": clip.profile,
        "repeated": clip.profile_repeated,
        "frames": clip.frames,
        "fps": clip.fps,
        "duration": clip.duration_frames,
        "curve": thinned(clip.closure),
        "other": thinned(clip.closure_other),
        "up": thinned(clip.lower_vertical_mm, lower_mm),
        "nasal": thinned(clip.lower_horizontal_mm, lower_mm),
    }


# A character at closures from open to shut, one picture below the other, for the dashboard's blinks page.
#
# The dashboard may not draw characters itself (docs/explanation/architecture.md), so it is given these files.

STRIPS_FILE = "strips.json"
STEPS = 33
SIZE_PX = (480, 180)
QUALITY = 72


def strip(character: str, size_px: tuple[int, int] = SIZE_PX, steps: int = STEPS) -> bytes:
    """WebP of `steps` frames, closure 0 at the top to 1 at the bottom in equal steps."""
    levels = find_character(character).levels(size_px)
    frames = [levels.picture(float(closure)) for closure in np.linspace(0.0, 1.0, steps)]
    buffer = BytesIO()
    Image.fromarray(np.vstack(frames)).save(buffer, "WEBP", quality=QUALITY, method=4)
    return buffer.getvalue()


def strip_names(names: Sequence[str] = ()) -> tuple[str, ...]:
    """Characters, of the shipped ones or of `names`, whose whole frame has a strip's shape.

    A face from forehead to chin is left out: cut to a strip it would show what its eyes' character does.
    """
    shape = SIZE_PX[1] / SIZE_PX[0]
    sizes = {name: geometry(name).size_px for name in names or shipped_names()}
    return tuple(name for name, (width, height) in sizes.items() if height / width < 1.1 * shape)


def write_strips(folder: Path, characters: Sequence[str] = ()) -> list[tuple[str, int]]:
    """Write `NAME.webp` of each character (of `strip_names` where none is named) and, last, `strips.json`.

    Returns name and bytes of each.
    """
    written = []
    for name in characters or strip_names():
        content = strip(name)
        write_bytes(folder / f"{name}.webp", content)
        written.append((name, len(content)))
    declared = {
        "width_px": SIZE_PX[0],
        "height_px": SIZE_PX[1],
        "closures": np.linspace(0.0, 1.0, STEPS).tolist(),
        "characters": [name for name, _ in written],
    }
    write_bytes(folder / STRIPS_FILE, (json.dumps(declared, indent=2) + "\n").encode())
    return written


# How much detail and motion clips have: spatial and temporal information by ITU-T P.910.


def spatial_temporal_information(path: Path) -> tuple[float, float]:
    r"""SI and TI of a video, in values of its luminance from 0 (black) to 255 (white), whatever its format.

    Parameters
    ----------
    path : pathlib.Path

    Returns
    -------
    si, ti : float
        TI is 0 for a single frame.

    Raises
    ------
    InputError
        No video, or a damaged one.

    Notes
    -----
    ITU-T P.910, section 7.8. With the luminance :math:`F_n` of frame n and the standard deviation over pixels

    .. math::

        SI = \max_n \mathrm{sd}[\mathrm{Sobel}(F_n)], \qquad
        TI = \max_n \mathrm{sd}[F_n - F_{n-1}] \tag{1}

    The Sobel magnitude is that of two 3 x 3 kernels with weights 1, 2, 1; the outermost pixels have none.
    """
    si = ti = 0.0
    before = None
    for _, picture in decode(path, lambda frame: frame.to_ndarray(format="gray")):
        luminance = picture.astype(np.float64)
        across = cv2.Sobel(luminance, cv2.CV_64F, 1, 0)[1:-1, 1:-1]
        down = cv2.Sobel(luminance, cv2.CV_64F, 0, 1)[1:-1, 1:-1]
        si = max(si, float(np.hypot(across, down).std()))
        if before is not None:
            ti = max(ti, float((luminance - before).std()))
        before = luminance
    return si, ti
