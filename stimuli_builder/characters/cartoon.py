"""The cartoon character: vector drawing at build time, any size, any closure (no lower-lid signals)."""

import hashlib
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np
import skia
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.characters.cartoon_eye import (
    EYES,
    Curve,
    bezier,
    colour,
    draw_eye,
    draw_eyeball,
    draw_socket,
    fill,
    glow,
    polygon,
    taper,
    wash,
)

# The cartoon's face around the eyes: skin, nose, freckles, brows. Light comes from the image's left.

Outline = tuple[Curve, Curve]
SKIN, INK = "#f0b48c", "#4b2a21"
BROW, BROW_LIGHT = "#6d3722", "#9a5632"
BROW_DROP_MM = 0.45
"""How far the brow sinks with the lid: barely, but a brow that stands still looks glued on."""


def draw_skin(canvas: skia.Canvas) -> None:
    """Skin, cheeks, nose and freckles."""
    canvas.drawPaint(skia.Paint(Color=colour(SKIN)))
    stops = [
        colour("#ffdcb6", 0.85),
        colour("#ffdcb6", 0.1),
        colour("#b4603f", 0.12),
        colour("#9c4d3c", 0.58),
    ]
    wash(canvas, (-66.0, 16.0), (66.0, -8.0), stops, (0.0, 0.42, 0.66, 1.0))
    wash(canvas, (0.0, 28.0), (0.0, 8.0), [colour("#ffe3c2", 0.35), colour("#ffe3c2", 0.0)], (0.0, 1.0))
    for x, strength in ((-40.0, 0.55), (38.0, 0.62)):
        blush = [colour("#e8685a", strength * 0.62), colour("#e8685a", 0.0)]
        glow(canvas, (x, -23.0), 19.0, blush, (0.0, 1.0))
    _nose(canvas)
    _freckles(canvas)


def _nose(canvas: skia.Canvas) -> None:
    # The far side of the bridge lies in shade, its near side catches the light.
    xs, ys = bezier(
        [
            (7.0, 15.0),
            (3.6, 6.0),
            (4.6, -5.0),
            (8.8, -21.0),
            (11, -30.0),
            (18.0, -30.0),
            (17.0, -22.0),
            (13.5, -9.0),
            (12.0, 4.0),
            (7.0, 15.0),
        ]
    )
    fill(canvas, polygon(xs, ys), colour("#a9563f", 0.38), 1.6)
    light = skia.Paint(AntiAlias=True, Color=colour("#fff0da", 0.62))
    light.setMaskFilter(skia.MaskFilter.MakeBlur(skia.kNormal_BlurStyle, 1.7))
    canvas.drawOval(skia.Rect.MakeLTRB(-3.8, -26.0, 1.6, 7.0), light)
    xs, ys = bezier([(7.4, 12.5), (4.9, 5.0), (5.6, -4.5), (9.4, -20.5)])
    taper(canvas, xs, ys, 0.95, colour(INK, 0.75), ends=(0.1, 0.25), peak=0.6)


def _freckles(canvas: skia.Canvas) -> None:
    rng = np.random.default_rng(11)
    for index in range(90):
        side = -1 if index % 2 else 1
        x = side * rng.triangular(7.5, 17.0, 44.0)
        y = rng.normal(-15.6 - 0.05 * abs(x), 2.1)
        size = rng.uniform(0.16, 0.46)
        spot = skia.Paint(AntiAlias=True, Color=colour("#a4563a", rng.uniform(0.18, 0.5)))
        canvas.drawOval(skia.Rect.MakeXYWH(x, y, size * 1.25, size), spot)


def draw_brow(canvas: skia.Canvas, side: int) -> None:
    """One brow over the open eye; the one at the image's right stands a touch higher, as most do."""
    canvas.save()
    canvas.translate(side * 30.0, 0.9 if side > 0 else 0.0)
    canvas.scale(side, 1)
    canvas.rotate(1.2 if side > 0 else 0.0)
    top = bezier(
        [(-17.6, 13.4), (-14.6, 18.6), (-3.0, 22.2), (8.0, 21.2), (14.5, 20.4), (20.0, 17.0), (23.6, 11.8)]
    )
    low = bezier(
        [
            (23.6, 11.8),
            (18.5, 15.4),
            (13.0, 17.2),
            (7.0, 17.2),
            (-2.0, 17.3),
            (-9.5, 14.2),
            (-15.2, 11.4),
            (-17.6, 10.4),
            (-18.6, 11.4),
            (-17.6, 13.4),
        ]
    )
    shape = polygon(np.r_[top[0], low[0]], np.r_[top[1], low[1]])
    canvas.save()
    canvas.translate(0.25 * side, -0.8)
    fill(canvas, shape, colour("#8a4630", 0.30), 0.9)
    canvas.restore()
    fill(canvas, shape, colour(BROW))
    canvas.save()
    canvas.clipPath(shape, True)
    wash(canvas, (0.0, 22.0), (0.0, 14.0), [colour(BROW_LIGHT, 0.75), colour(BROW_LIGHT, 0.0)], (0.0, 1.0))
    _brow_hairs(canvas, top, low)
    canvas.restore()
    canvas.restore()


def _brow_hairs(canvas: skia.Canvas, top: Outline, low: Outline) -> None:
    """Fine strokes along the brow: upright at the nose, lying flat towards the temple."""
    rng = np.random.default_rng(3)
    for t in np.linspace(0.03, 0.95, 44):
        across = rng.uniform(0.05, 0.95)
        at = int(t * (len(top[0]) - 1))
        # The lower outline runs back towards the nose; its last part is the brow's blunt head.
        back = int((1 - t) * 0.72 * (len(low[0]) - 1))
        root = (1 - across) * np.array([top[0][at], top[1][at]]) + across * np.array(
            [low[0][back], low[1][back]]
        )
        angle = np.deg2rad(70 - 96 * t**0.8 + rng.uniform(-7, 7))
        length = rng.uniform(2.6, 4.2) * (1 - 0.4 * t) * (0.4 + 0.6 * across)
        reach = np.linspace(0, 1, 8)[:, None]
        hair = (
            root
            + reach * length * np.array([np.cos(angle), np.sin(angle)])
            + reach**2 * np.array([0.5, -0.3])
        )
        ink = colour("#43200f", 0.40) if rng.random() < 0.6 else colour("#b8744a", 0.45)
        taper(canvas, hair[:, 0], hair[:, 1], 0.42, ink, ends=(0.5, 0.0), peak=0.3)


NAME = "cartoon"
FRAME_MM = (128.0, 48.0)
INTER_OCULAR_MM = 60.0
LEVELS = 129
CROP_MM = (-57.0, -14.0, 57.0, 26.0)
"""What a blink changes, brows included: left, bottom, right, top in mm."""
BROW_BAND_MM = (25.0, 7.5)
_CENTRE_Y_MM = 3.5


def draw_frame(
    closure: float, size_px: tuple[int, int], window: tuple[int, int, int, int] | None = None
) -> NDArray[np.float32]:
    """(h, w, 3) gamma-encoded sRGB in 0-1 of the character at a closure (0 open, 1 closed).

    Parameters
    ----------
    size_px : (width, height)
        Of the whole frame; 8:3.
    window : (x, y, width, height), optional
        The part of the frame to draw.
    """
    if not 0.0 <= closure <= 1.0:
        raise InputError(f"closure must lie between 0 (open) and 1 (closed), got {closure:g}")
    x, y, width, height = window or (0, 0, *size_px)
    picture = _rasterise(closure, size_px, (x, y, width, height))
    return picture + _grain(size_px)[y : y + height, x : x + width, None]


def crop_px(size_px: tuple[int, int]) -> tuple[int, int, int, int]:
    """The part of the frame that a blink changes: x, y, width, height in px, all even."""
    scale = size_px[0] / FRAME_MM[0]
    left, bottom, right, top = CROP_MM
    x0 = _even(size_px[0] / 2 + left * scale)
    x1 = _even(size_px[0] / 2 + right * scale)
    y0 = _even(size_px[1] / 2 - (top - _CENTRE_Y_MM) * scale)
    y1 = _even(size_px[1] / 2 - (bottom - _CENTRE_Y_MM) * scale)
    x0, y0, x1, y1 = max(0, x0), max(0, y0), min(size_px[0], x1), min(size_px[1], y1)
    return x0, y0, x1 - x0, y1 - y0


def fingerprint() -> str:
    """SHA-256 of all that decides how the cartoon looks: its source and the drawing library's version."""
    digest = hashlib.sha256(skia.__version__.encode())
    for file in sorted(Path(__file__).parent.glob("cartoon*.py")):
        digest.update(file.read_bytes())
    return digest.hexdigest()


def _rasterise(
    closure: float, size_px: tuple[int, int], window: tuple[int, int, int, int]
) -> NDArray[np.float32]:
    x, y, width, height = window
    surface = _surface(width, height)
    canvas = surface.getCanvas()
    canvas.translate(-x, -y)
    skin, brows, eyeballs = _still_parts(size_px)
    canvas.drawImage(skin, 0, 0)
    _lower_brows(canvas, brows, closure, size_px)

    def paint_eyeballs(target: skia.Canvas) -> None:
        target.save()
        target.setMatrix(skia.Matrix.Translate(-x, -y))
        target.drawImage(eyeballs, 0, 0)
        target.restore()

    _to_mm(canvas, size_px)
    for shape in EYES:
        draw_eye(canvas, shape, closure, paint_eyeballs)
    pixels = np.empty((height, width, 4), np.float16)
    surface.readPixels(surface.imageInfo(), pixels, pixels.strides[0], 0, 0)
    return pixels[..., :3].astype(np.float32)


def _lower_brows(canvas: skia.Canvas, brows: skia.Image, closure: float, size_px: tuple[int, int]) -> None:
    smooth = skia.SamplingOptions(skia.CubicResampler.Mitchell())
    scale = size_px[0] / FRAME_MM[0]
    for shape in EYES:
        canvas.save()
        middle = size_px[0] / 2 + shape.side * 32.0 * scale
        top, bottom = (size_px[1] / 2 - (y - _CENTRE_Y_MM) * scale for y in BROW_BAND_MM)
        canvas.clipRect(skia.Rect.MakeLTRB(middle - 24 * scale, top, middle + 24 * scale, bottom))
        canvas.drawImage(brows, 0, BROW_DROP_MM * closure * scale, smooth)
        canvas.restore()


@lru_cache(maxsize=2)
def _still_parts(size_px: tuple[int, int]) -> tuple[skia.Image, skia.Image, skia.Image]:
    """Skin, brows and eyeballs: what keeps its form in a blink is drawn once."""

    def draw_all(paint: Callable[[skia.Canvas], None]) -> skia.Image:
        surface = _surface(*size_px)
        canvas = surface.getCanvas()
        _to_mm(canvas, size_px)
        paint(canvas)
        return surface.makeImageSnapshot()

    def skin(canvas: skia.Canvas) -> None:
        draw_skin(canvas)
        for shape in EYES:
            draw_socket(canvas, shape)

    def brows(canvas: skia.Canvas) -> None:
        for shape in EYES:
            draw_brow(canvas, shape.side)

    def eyeballs(canvas: skia.Canvas) -> None:
        for shape in EYES:
            draw_eyeball(canvas, shape)

    return draw_all(skin), draw_all(brows), draw_all(eyeballs)


def _surface(width: int, height: int) -> skia.Surface:
    # 16-bit floats: 8 bits would band the skin before it is averaged over a shutter time.
    space = skia.ColorSpace.MakeSRGB()
    info = skia.ImageInfo.Make(width, height, skia.kRGBA_F16_ColorType, skia.kPremul_AlphaType, space)
    return skia.Surface.MakeRaster(info)


def _to_mm(canvas: skia.Canvas, size_px: tuple[int, int]) -> None:
    scale = size_px[0] / FRAME_MM[0]
    canvas.translate(size_px[0] / 2, size_px[1] / 2)
    canvas.scale(scale, -scale)
    canvas.translate(0, -_CENTRE_Y_MM)


@lru_cache(maxsize=2)
def _grain(size_px: tuple[int, int]) -> NDArray[np.float32]:
    """Fixed noise of one code value: gradients this smooth would show bands in 8 bits."""
    rng = np.random.default_rng(2011)
    return rng.uniform(-0.5 / 255, 0.5 / 255, (size_px[1], size_px[0])).astype(np.float32)


def _even(value: float) -> int:
    return 2 * round(value / 2)
