"""How drawn characters are inked (paths, strokes, shades; mm, y up), and what differs between them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import skia
from numpy.typing import NDArray

Curve = NDArray[np.float64]
Point = tuple[float, float]


def colour(code: str, opacity: float = 1.0) -> int:
    """The skia colour of `#rrggbb` at an opacity in 0-1."""
    red, green, blue = (int(code[i : i + 2], 16) for i in (1, 3, 5))
    return int(skia.Color(red, green, blue, round(255 * opacity)))


@dataclass(frozen=True)
class EyeShape:
    """What differs between the two eyes; lengths in mm, `side` -1 for the eye at the image's left.

    `lead` is how much further this eye has closed halfway through a blink; the two sum to zero.
    """

    side: int
    centre_y_mm: float
    tilt: float
    crease_mm: float
    lash_scale: float
    lead: float = 0.0


@dataclass(frozen=True)
class CartoonLook:
    """What differs between the drawn characters.

    Attributes
    ----------
    name : str
    eyes : tuple of EyeShape
        At the image's left and right.
    tint : tuple of float
        Factors of red, green and blue by which every color of the skin is darkened.
    brow, brow_light, brow_shade : str
        Color of a brow, of its lit upper part, and of its soft shade on the skin.
    brow_height : float
        Thickness of the brows, as a share of the first character's.
    hairs : tuple of str
        Dark and light strokes of a brow.
    iris : tuple of str
        Of its gradient, from the lower edge to the upper.
    iris_glow : str
        Around the pupil.
    freckles : int
    darkens : bool
        Whether the lids' shade covers the last of the iris while the eye closes: without it a rim as thin as
        a line stays in the iris's color, which motion blur spreads.
    """

    name: str
    eyes: tuple[EyeShape, EyeShape]
    tint: tuple[float, float, float]
    brow: str
    brow_light: str
    brow_shade: str
    brow_height: float
    hairs: tuple[str, str]
    iris: tuple[str, str, str, str]
    iris_glow: str
    freckles: int
    darkens: bool

    def skin(self, code: str, opacity: float = 1.0) -> int:
        """A color of the first character's skin, as this character has it."""
        parts = (round(int(code[1 + 2 * k : 3 + 2 * k], 16) * self.tint[k]) for k in range(3))
        return colour("#" + "".join(f"{part:02x}" for part in parts), opacity)


CARTOON = CartoonLook(
    "cartoon",
    (EyeShape(-1, 0.0, 0.075, 2.5, 1.0), EyeShape(1, 0.25, 0.068, 2.15, 0.95)),
    (1.0, 1.0, 1.0),
    "#6d3722",
    "#9a5632",
    "#8a4630",
    1.0,
    ("#43200f", "#b8744a"),
    ("#1f5a5c", "#2f8a80", "#63c3a0", "#c2edb9"),
    "#e2b45c",
    90,
    darkens=False,
)
WILLOW = CartoonLook(
    "cartoon-willow",
    (EyeShape(-1, 0.2, 0.05, 3.1, 1.12, 0.025), EyeShape(1, 0.0, 0.062, 2.7, 1.18, -0.025)),
    (0.62, 0.48, 0.41),
    "#241510",
    "#4a2c20",
    "#3c2018",
    0.74,
    ("#140a07", "#5d3a2a"),
    ("#3a1d0e", "#66371a", "#9c6230", "#dca45f"),
    "#7a3f1c",
    0,
    darkens=True,
)
LOOKS = {look.name: look for look in (CARTOON, WILLOW)}


def polygon(xs: Curve, ys: Curve, closed: bool = True) -> skia.Path:
    """The path through the points (xs, ys)."""
    path = skia.Path()
    path.addPoly([skia.Point(float(x), float(y)) for x, y in zip(xs, ys, strict=True)], closed)
    return path


def between(xs: Curve, upper: Curve, lower: Curve) -> skia.Path:
    """The area between two curves over the same xs."""
    return polygon(np.r_[xs, xs[::-1]], np.r_[upper, lower[::-1]])


def bezier(points: Sequence[Point], steps: int = 24) -> tuple[Curve, Curve]:
    """Points along a chain of cubic Beziers: a start, then two handles and an end for each."""
    t = np.linspace(0.0, 1.0, steps)[:, None]
    nodes = np.array(points, dtype=float)
    parts = [
        (1 - t) ** 3 * nodes[i]
        + 3 * t * (1 - t) ** 2 * nodes[i + 1]
        + 3 * t**2 * (1 - t) * nodes[i + 2]
        + t**3 * nodes[i + 3]
        for i in range(0, len(nodes) - 3, 3)
    ]
    line = np.vstack(parts)
    return line[:, 0], line[:, 1]


def fill(canvas: skia.Canvas, path: skia.Path, paint_colour: int, blur_mm: float = 0.0) -> None:
    """Fill a path, its edge softened by `blur_mm`."""
    canvas.drawPath(path, _paint(blur_mm, Color=paint_colour))


def taper(
    canvas: skia.Canvas,
    xs: Curve,
    ys: Curve,
    width_mm: float,
    paint_colour: int,
    *,
    ends: tuple[float, float] = (0.15, 0.15),
    peak: float = 0.5,
    blur_mm: float = 0.0,
) -> None:
    """Ink a line that swells to `width_mm` at `peak` of its length and thins to `ends` shares of it."""
    t = np.linspace(0.0, 1.0, len(xs))
    rise = np.sin(np.pi / 2 * np.clip(t / peak, 0, 1)) if peak > 0 else np.ones_like(t)
    fall = np.sin(np.pi / 2 * np.clip((1 - t) / (1 - peak), 0, 1)) if peak < 1 else np.ones_like(t)
    swell = np.where(t < peak, ends[0] + (1 - ends[0]) * rise, ends[1] + (1 - ends[1]) * fall)
    dx, dy = np.gradient(xs), np.gradient(ys)
    length = np.maximum(np.hypot(dx, dy), 1e-9)
    nx, ny = -dy / length * swell * width_mm / 2, dx / length * swell * width_mm / 2
    outline = polygon(np.r_[xs + nx, (xs - nx)[::-1]], np.r_[ys + ny, (ys - ny)[::-1]])
    fill(canvas, outline, paint_colour, blur_mm)


def glow(
    canvas: skia.Canvas, centre: Point, radius_mm: float, stops: Sequence[int], at: Sequence[float]
) -> None:
    """A disc shaded from its centre outwards."""
    shader = skia.GradientShader.MakeRadial(centre, radius_mm, list(stops), list(at))
    canvas.drawCircle(*centre, radius_mm, _paint(0.0, Shader=shader))


def wash(canvas: skia.Canvas, start: Point, end: Point, stops: Sequence[int], at: Sequence[float]) -> None:
    """A linear shade over everything the canvas is clipped to."""
    canvas.drawPaint(_paint(0.0, Shader=skia.GradientShader.MakeLinear([start, end], list(stops), list(at))))


def _paint(blur_mm: float, **settings: object) -> skia.Paint:
    paint = skia.Paint(AntiAlias=True, **settings)
    if blur_mm > 0:
        paint.setMaskFilter(skia.MaskFilter.MakeBlur(skia.kNormal_BlurStyle, blur_mm))
    return paint
