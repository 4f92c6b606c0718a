"""The cartoon's face around the eyes: skin, nose, freckles, brows. Light comes from the image's left."""

import numpy as np
import skia

from stimuli_builder.characters.cartoon_pen import (
    CartoonLook,
    Curve,
    bezier,
    colour,
    fill,
    glow,
    polygon,
    taper,
    wash,
)

Outline = tuple[Curve, Curve]
SKIN, INK = "#f0b48c", "#4b2a21"
BROW_MIDDLE_MM = 16.5
BROW_DROP_MM = 0.45
"""How far the brow sinks with the lid: barely, but a brow that stands still looks glued on."""


def draw_skin(canvas: skia.Canvas, look: CartoonLook) -> None:
    """Skin, cheeks, nose and freckles."""
    canvas.drawPaint(skia.Paint(Color=look.skin(SKIN)))
    stops = [
        look.skin("#ffdcb6", 0.85),
        look.skin("#ffdcb6", 0.1),
        look.skin("#b4603f", 0.12),
        look.skin("#9c4d3c", 0.58),
    ]
    wash(canvas, (-66.0, 16.0), (66.0, -8.0), stops, (0.0, 0.42, 0.66, 1.0))
    wash(canvas, (0.0, 28.0), (0.0, 8.0), [look.skin("#ffe3c2", 0.35), look.skin("#ffe3c2", 0.0)], (0.0, 1.0))
    for x, strength in ((-40.0, 0.55), (38.0, 0.62)):
        blush = [look.skin("#e8685a", strength * 0.62), look.skin("#e8685a", 0.0)]
        glow(canvas, (x, -23.0), 19.0, blush, (0.0, 1.0))
    _nose(canvas, look)
    _freckles(canvas, look)


def _nose(canvas: skia.Canvas, look: CartoonLook) -> None:
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
    fill(canvas, polygon(xs, ys), look.skin("#a9563f", 0.38), 1.6)
    light = skia.Paint(AntiAlias=True, Color=look.skin("#fff0da", 0.62))
    light.setMaskFilter(skia.MaskFilter.MakeBlur(skia.kNormal_BlurStyle, 1.7))
    canvas.drawOval(skia.Rect.MakeLTRB(-3.8, -26.0, 1.6, 7.0), light)
    xs, ys = bezier([(7.4, 12.5), (4.9, 5.0), (5.6, -4.5), (9.4, -20.5)])
    taper(canvas, xs, ys, 0.95, colour(INK, 0.75), ends=(0.1, 0.25), peak=0.6)


def _freckles(canvas: skia.Canvas, look: CartoonLook) -> None:
    rng = np.random.default_rng(11)
    for index in range(look.freckles):
        side = -1 if index % 2 else 1
        x = side * rng.triangular(7.5, 17.0, 44.0)
        y = rng.normal(-15.6 - 0.05 * abs(x), 2.1)
        size = rng.uniform(0.16, 0.46)
        spot = skia.Paint(AntiAlias=True, Color=look.skin("#a4563a", rng.uniform(0.18, 0.5)))
        canvas.drawOval(skia.Rect.MakeXYWH(x, y, size * 1.25, size), spot)


def draw_brow(canvas: skia.Canvas, side: int, look: CartoonLook) -> None:
    """One brow over the open eye; the one at the image's right stands a touch higher, as most do."""
    canvas.save()
    canvas.translate(side * 30.0, 0.9 if side > 0 else 0.0)
    canvas.scale(side, 1)
    canvas.rotate(1.2 if side > 0 else 0.0)
    # About the middle of its height: a thinner brow stays where it is.
    canvas.translate(0.0, BROW_MIDDLE_MM * (1 - look.brow_height))
    canvas.scale(1.0, look.brow_height)
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
    fill(canvas, shape, colour(look.brow_shade, 0.30), 0.9)
    canvas.restore()
    fill(canvas, shape, colour(look.brow))
    canvas.save()
    canvas.clipPath(shape, True)
    lit = [colour(look.brow_light, 0.75), colour(look.brow_light, 0.0)]
    wash(canvas, (0.0, 22.0), (0.0, 14.0), lit, (0.0, 1.0))
    _brow_hairs(canvas, top, low, look)
    canvas.restore()
    canvas.restore()


def _brow_hairs(canvas: skia.Canvas, top: Outline, low: Outline, look: CartoonLook) -> None:
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
        ink = colour(look.hairs[0], 0.40) if rng.random() < 0.6 else colour(look.hairs[1], 0.45)
        taper(canvas, hair[:, 0], hair[:, 1], 0.42, ink, ends=(0.5, 0.0), peak=0.3)
