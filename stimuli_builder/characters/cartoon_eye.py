"""One cartoon eye: margins calibrated to the declared opening, eyeball, lid, lashes."""

from collections.abc import Callable

import numpy as np
import skia

from stimuli_builder.characters.cartoon_pen import (
    CartoonLook,
    Curve,
    EyeShape,
    between,
    colour,
    fill,
    glow,
    polygon,
    taper,
    wash,
)

OPENING_MM = 11.0
NASAL_MM, LATERAL_MM = -13.4, 13.6
LOWER_RISE_MM = 0.7
INK, LASH = "#3d211c", "#241311"
LASHES = (
    (0.34, 1.5, 0.40),
    (0.47, 2.0, 0.44),
    (0.59, 2.6, 0.47),
    (0.71, 3.3, 0.52),
    (0.82, 4.0, 0.57),
    (0.92, 4.6, 0.62),
)
"""Lash clumps: place along the margin (0 nasal, 1 lateral), length and root width in mm."""


CATCH_LIGHTS = ((-2.25, 2.15, 1.55, 0.98), (2.3, -2.7, 0.62, 0.75))
"""Window and bounce: x towards the image's right, y, radius in mm, opacity."""


def margins(shape: EyeShape, closure: float) -> tuple[Curve, Curve, Curve]:
    """Local x (lateral positive) and the visible edges of upper and lower lid in mm at a closure.

    What shows of the eyeball lies between them: OPENING_MM (1 - closure) high where it is highest. Where one
    eye leads, that is the mean of both.
    """
    closure = closure + shape.lead * np.sin(np.pi * closure)
    x, upper, lower = _open_margins(shape)
    u = (x - NASAL_MM) / (LATERAL_MM - NASAL_MM)
    raised = lower + LOWER_RISE_MM * closure * np.sin(np.pi * u) ** 1.5
    return x, raised + (1 - closure) * (upper - lower), raised


def _open_margins(shape: EyeShape) -> tuple[Curve, Curve, Curve]:
    x = np.linspace(NASAL_MM, LATERAL_MM, 161)
    u = (x - NASAL_MM) / (LATERAL_MM - NASAL_MM)
    axis = -0.6 + shape.tilt * x
    upper = 5.75 * np.sin(np.pi * u**0.92) ** 0.66 * (1 + 0.08 * (u - 0.5))
    lower = -5.25 * np.sin(np.pi * u**1.12) ** 0.80
    scale = OPENING_MM / np.max(upper - lower)
    return x, axis + upper * scale, axis + lower * scale


def draw_eye(
    canvas: skia.Canvas,
    shape: EyeShape,
    closure: float,
    paint_eyeball: Callable[[skia.Canvas], None],
    look: CartoonLook,
) -> None:
    """Draw the eye at a closure on a canvas in mm, the origin midway between the eyes.

    `paint_eyeball` puts down what `draw_eyeball` drew before: it is slow and no blink moves it.
    """
    canvas.save()
    _go_to(canvas, shape)
    x, upper, lower = margins(shape, closure)
    _, open_upper, _ = margins(shape, 0.0)
    if closure < 1.0:
        canvas.save()
        # The lash line covers the upper seam, so the eyeball may reach under it.
        canvas.clipPath(between(x, upper + 0.25, lower), True)
        paint_eyeball(canvas)
        _lid_shadow(canvas, shape, x, upper)
        if look.darkens:
            canvas.drawPaint(skia.Paint(Color=colour(LASH, float(np.clip((closure - 0.7) / 0.2, 0.0, 1.0)))))
        canvas.restore()
    _upper_lid(canvas, shape, (x, upper, open_upper), closure, look)
    _lower_lid(canvas, x, lower, look)
    _lash_line(canvas, shape, x, upper, closure)
    canvas.restore()


def _go_to(canvas: skia.Canvas, shape: EyeShape) -> None:
    canvas.translate(shape.side * 30.0, shape.centre_y_mm)
    canvas.scale(shape.side, 1)


def draw_socket(canvas: skia.Canvas, shape: EyeShape, look: CartoonLook) -> None:
    """Shade the hollow around one eye."""
    canvas.save()
    _go_to(canvas, shape)
    canvas.scale(1, 0.72)
    shade = [look.skin("#b4664a", 0.42), look.skin("#b4664a", 0.20), look.skin("#b4664a", 0.0)]
    glow(canvas, (-1.0, 4.6), 21.0, shade, (0.0, 0.55, 1.0))
    # The light comes from the image's left, so each socket is deeper on its far side.
    nose_side = -6.0 * shape.side
    glow(canvas, (-nose_side, 6.0), 13.0, [look.skin("#8e4a3c", 0.20), look.skin("#8e4a3c", 0.0)], (0.0, 1.0))
    canvas.restore()


def draw_eyeball(canvas: skia.Canvas, shape: EyeShape, look: CartoonLook) -> None:
    """Draw white, caruncle and iris of one eye, wider than any opening."""
    canvas.save()
    _go_to(canvas, shape)
    box = skia.Rect.MakeLTRB(NASAL_MM - 1, -9.0, LATERAL_MM + 1, 9.0)
    canvas.clipRect(box)
    canvas.drawPaint(skia.Paint(Color=colour("#fbf6ee")))
    shade = [colour("#fffdf8", 0.0), colour("#c9bfc6", 0.28), colour("#77718f", 0.72)]
    glow(canvas, (-2.2 * shape.side, 1.2), 17.5, shade, (0.0, 0.55, 1.0))
    fill(canvas, polygon(*_caruncle(shape)), colour("#e8a496"), 0.35)
    _iris(canvas, shape.side, look)
    canvas.restore()


def _lid_shadow(canvas: skia.Canvas, shape: EyeShape, x: Curve, upper: Curve) -> None:
    fill(canvas, between(x, upper + 8.0, upper - 2.1), colour("#2b1c3a", 0.42), 0.55)
    for cx, cy, radius, opacity in CATCH_LIGHTS:
        light = skia.Paint(AntiAlias=True, Color=colour("#ffffff", opacity))
        canvas.drawCircle(cx * shape.side, cy, radius, light)


def _caruncle(shape: EyeShape) -> tuple[Curve, Curve]:
    angle = np.linspace(0, 2 * np.pi, 40)
    y = -0.6 + shape.tilt * NASAL_MM
    return NASAL_MM + 0.5 + 2.1 * np.cos(angle), y - 0.15 + 1.35 * np.sin(angle)


def _iris(canvas: skia.Canvas, side: int, look: CartoonLook) -> None:
    canvas.save()
    # Both eyes converge a little on the viewer.
    canvas.translate(-0.25, -0.15)
    radius = 6.15
    rim = [colour("#1c3b3f"), colour("#173238"), colour("#0f2228")]
    glow(canvas, (0.0, 0.0), radius, rim, (0.0, 0.9, 1.0))
    canvas.save()
    disc = skia.Path()
    disc.addCircle(0, 0, radius - 0.62)
    canvas.clipPath(disc, True)
    wash(
        canvas,
        (-1.2 * side, radius),
        (1.2 * side, -radius),
        [colour(code) for code in look.iris],
        (0.0, 0.38, 0.72, 1.0),
    )
    _streaks(canvas)
    glow(
        canvas,
        (0.0, 0.0),
        4.1,
        [colour(look.iris_glow, opacity) for opacity in (0.85, 0.5, 0.0)],
        (0, 0.72, 1),
    )
    canvas.restore()
    canvas.drawCircle(0, 0, 2.75, skia.Paint(AntiAlias=True, Color=colour("#0e1418")))
    canvas.restore()


def _streaks(canvas: skia.Canvas) -> None:
    for index in range(26):
        angle = 2 * np.pi * (index + 0.35 * np.sin(5.0 * index)) / 26
        reach = np.array([2.8, 4.0, 5.2 + 0.35 * np.cos(3.0 * index)])
        light = index % 2 == 0
        ink = colour("#d9f7c9", 0.30) if light else colour("#0f4246", 0.34)
        taper(canvas, reach * np.cos(angle), reach * np.sin(angle), 0.34, ink, ends=(0.3, 0.0))


def _upper_lid(
    canvas: skia.Canvas,
    shape: EyeShape,
    curves: tuple[Curve, Curve, Curve],
    closure: float,
    look: CartoonLook,
) -> None:
    x, upper, open_upper = curves
    u = (x - NASAL_MM) / (LATERAL_MM - NASAL_MM)
    bow = np.sin(np.pi * np.clip(u, 0, 1))
    crease = open_upper + 0.35 + shape.crease_mm * bow**0.6 - 0.8 * closure * bow
    crease = np.maximum(crease, upper)
    canvas.save()
    # Down to the middle of the lash line, which hides the seam.
    canvas.clipPath(between(x, np.maximum(crease, upper + 0.2), upper + 0.2), True)
    canvas.drawPaint(skia.Paint(Color=look.skin("#dd9a76")))
    middle = float(np.mean(upper + crease) / 2)
    shine = [look.skin("#ffd3ae", 1.0), look.skin("#efb48d", 0.9), look.skin("#d08c6a", 0.0)]
    glow(canvas, (-3.6 * shape.side, middle + 1.0 + 0.8 * closure), 12.5, shine, (0.0, 0.5, 1.0))
    taper(canvas, x, crease, 3.4, look.skin("#9c5540", 0.55), blur_mm=0.8)
    # The margin turns away from the light and picks up the lashes' warmth.
    taper(canvas, x, upper + 0.9, 1.8, look.skin("#a45a4a", 0.30 + 0.1 * closure), blur_mm=0.5)
    canvas.restore()
    inside = slice(6, -2)
    taper(
        canvas, x[inside], crease[inside], 0.82 - 0.30 * closure, colour(INK, 0.92 - 0.25 * closure), peak=0.6
    )


def _lower_lid(canvas: skia.Canvas, x: Curve, lower: Curve, look: CartoonLook) -> None:
    inside = slice(10, None)
    # The lower edge of the picture of the eye is `lower`: rim and line lie below it.
    taper(canvas, x[inside], lower[inside] - 0.42, 0.85, look.skin("#f6b59b"), ends=(0.2, 0.5))
    taper(canvas, x[inside], lower[inside] - 0.92, 0.55, colour(INK, 0.85), ends=(0.05, 0.9), peak=0.8)
    fold = slice(28, 128)
    bow = np.sin(np.linspace(0, np.pi, 100))
    taper(canvas, x[fold], lower[fold] - 2.0 - 1.1 * bow, 0.5, look.skin("#a5573f", 0.45), blur_mm=0.12)
    for share, length in ((0.80, 1.2), (0.88, 1.5)):
        at = int(share * (len(x) - 1))
        start = np.array([x[at], lower[at] - 0.95])
        tip = start + length * np.array([0.75, -0.66])
        line = np.linspace(start, tip, 8)
        taper(canvas, line[:, 0], line[:, 1], 0.42, colour(LASH, 0.9), ends=(1.0, 0.0), peak=0.05)


def _lash_line(canvas: skia.Canvas, shape: EyeShape, x: Curve, upper: Curve, closure: float) -> None:
    thickness = 1.75
    # Thick at the outer third; its lower edge is the visible margin.
    u = (x - NASAL_MM) / (LATERAL_MM - NASAL_MM)
    swell = 0.22 + 0.78 * np.sin(np.pi / 2 * np.clip(u / 0.78, 0, 1)) ** 1.3
    wing_t = np.linspace(0, 1, 14)[1:]
    rise = 0.95 - 1.5 * closure
    wing_x = LATERAL_MM + 2.9 * wing_t
    wing_low = upper[-1] + rise * wing_t + 0.55 * (0.5 - closure) * wing_t**2
    low = np.r_[upper, wing_low]
    high = np.r_[upper + thickness * swell, wing_low + thickness * (1 - wing_t) ** 1.1]
    fill(canvas, between(np.r_[x, wing_x], high, low), colour(LASH))
    for share, length, width in LASHES:
        _lash(canvas, shape, x, upper, closure, (share, length, width))


def _lash(
    canvas: skia.Canvas,
    shape: EyeShape,
    x: Curve,
    upper: Curve,
    closure: float,
    clump: tuple[float, float, float],
) -> None:
    share, length, width = clump
    at = int(share * (len(x) - 1))
    root = np.array([x[at], upper[at] + 1.0 * (1 - closure) + 0.35 * closure])
    # Lashes swing from up and out to down and out as the lid turns over the eyeball.
    opened, closed = np.deg2rad(72 - 42 * (share - 0.5) * 2), np.deg2rad(-66 + 44 * (share - 0.5) * 2)
    swing = 0.5 - 0.5 * np.cos(np.pi * closure)
    angle = opened + (closed - opened) * swing
    reach = length * shape.lash_scale * (1.0 - 0.45 * np.sin(np.pi * swing))
    t = np.linspace(0, 1, 12)[:, None]
    straight = np.array([np.cos(angle), np.sin(angle)])
    curl = np.array([-straight[1], straight[0]]) * (0.30 * (1 - 2 * swing))
    line = root + reach * (t * straight + t**2 * curl)
    taper(canvas, line[:, 0], line[:, 1], width * 1.5, colour(LASH), ends=(1.0, 0.0), peak=0.02)
