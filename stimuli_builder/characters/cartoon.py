"""The cartoon character: vector drawing at build time, any size, any closure (no lower-lid signals)."""

import hashlib
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np
import skia
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.characters.cartoon_eye import OPENING_MM, draw_eye, draw_eyeball, draw_socket
from stimuli_builder.characters.cartoon_face import BROW_DROP_MM, draw_brow, draw_skin
from stimuli_builder.characters.cartoon_pen import CARTOON, CartoonLook

FRAME_MM = (128.0, 48.0)
INTER_OCULAR_MM = 60.0
LEVELS = 129
CROP_MM = (-57.0, -14.0, 57.0, 26.0)
"""What a blink changes, brows included: left, bottom, right, top in mm."""
BROW_BAND_MM = (25.0, 7.5)
_CENTRE_Y_MM = 3.5

__all__ = ["INTER_OCULAR_MM", "LEVELS", "OPENING_MM", "crop_px", "draw_frame", "fingerprint"]


def draw_frame(
    closure: float,
    size_px: tuple[int, int],
    window: tuple[int, int, int, int] | None = None,
    look: CartoonLook = CARTOON,
) -> NDArray[np.float32]:
    """(h, w, 3) gamma-encoded sRGB in 0-1 of the character at a closure (0 open, 1 closed).

    Parameters
    ----------
    size_px : (width, height)
        Of the whole frame; 8:3.
    window : (x, y, width, height), optional
        The part of the frame to draw.
    look : CartoonLook
        The drawn character.
    """
    if not 0.0 <= closure <= 1.0:
        raise InputError(f"closure must lie between 0 (open) and 1 (closed), got {closure:g}")
    x, y, width, height = window or (0, 0, *size_px)
    picture = _rasterise(closure, size_px, (x, y, width, height), look)
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


def fingerprint(look: CartoonLook) -> str:
    """SHA-256 of all that decides how a drawn character looks: source, name, drawing library."""
    digest = hashlib.sha256(f"{skia.__version__} {look.name}".encode())
    for file in sorted(Path(__file__).parent.glob("cartoon*.py")):
        digest.update(file.read_bytes())
    return digest.hexdigest()


def _rasterise(
    closure: float, size_px: tuple[int, int], window: tuple[int, int, int, int], look: CartoonLook
) -> NDArray[np.float32]:
    x, y, width, height = window
    surface = _surface(width, height)
    canvas = surface.getCanvas()
    canvas.translate(-x, -y)
    skin, brows, eyeballs = _still_parts(size_px, look)
    canvas.drawImage(skin, 0, 0)
    _lower_brows(canvas, brows, closure, size_px)

    def paint_eyeballs(target: skia.Canvas) -> None:
        target.save()
        target.setMatrix(skia.Matrix.Translate(-x, -y))
        target.drawImage(eyeballs, 0, 0)
        target.restore()

    _to_mm(canvas, size_px)
    for shape in look.eyes:
        draw_eye(canvas, shape, closure, paint_eyeballs, look)
    pixels = np.empty((height, width, 4), np.float16)
    surface.readPixels(surface.imageInfo(), pixels, pixels.strides[0], 0, 0)
    return pixels[..., :3].astype(np.float32)


def _lower_brows(canvas: skia.Canvas, brows: skia.Image, closure: float, size_px: tuple[int, int]) -> None:
    smooth = skia.SamplingOptions(skia.CubicResampler.Mitchell())
    scale = size_px[0] / FRAME_MM[0]
    for side in (-1, 1):
        canvas.save()
        middle = size_px[0] / 2 + side * 32.0 * scale
        top, bottom = (size_px[1] / 2 - (y - _CENTRE_Y_MM) * scale for y in BROW_BAND_MM)
        canvas.clipRect(skia.Rect.MakeLTRB(middle - 24 * scale, top, middle + 24 * scale, bottom))
        canvas.drawImage(brows, 0, BROW_DROP_MM * closure * scale, smooth)
        canvas.restore()


@lru_cache(maxsize=2)
def _still_parts(size_px: tuple[int, int], look: CartoonLook) -> tuple[skia.Image, skia.Image, skia.Image]:
    """Skin, brows and eyeballs: what keeps its form in a blink is drawn once."""

    def draw_all(paint: Callable[[skia.Canvas], None]) -> skia.Image:
        surface = _surface(*size_px)
        canvas = surface.getCanvas()
        _to_mm(canvas, size_px)
        paint(canvas)
        return surface.makeImageSnapshot()

    def skin(canvas: skia.Canvas) -> None:
        draw_skin(canvas, look)
        for shape in look.eyes:
            draw_socket(canvas, shape, look)

    def brows(canvas: skia.Canvas) -> None:
        for shape in look.eyes:
            draw_brow(canvas, shape.side, look)

    def eyeballs(canvas: skia.Canvas) -> None:
        for shape in look.eyes:
            draw_eyeball(canvas, shape, look)

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
