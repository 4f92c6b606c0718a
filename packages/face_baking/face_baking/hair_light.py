"""Single pixels among hair that a renderer gets wrong. Imports numpy alone: Blender's Python runs it."""

import numpy as np
from numpy.typing import NDArray

DOT, SPARSE = 0.5, 0.25
"""A pixel covered so far, with all but one about it below SPARSE, is not a hair: hair continues to both
sides."""
GLINT = 3.0
"""A pixel this many times as bright as the hair about it is one ray that met a lamp by chance."""
ALONE = 1e-3
"""Coverage about a pixel below which there is no hair to compare it with."""
Light = NDArray[np.float32]


def without_specks(hair: Light) -> Light:
    """A hair layer whose broken and glaring pixels have their neighbors' light.

    Cycles leaves a pixel black and whole (0, 0, 0, 1) where the scattering of one of its rays in a thin hair
    came out as no number; among brown hairs that is a dot of ink.

    Parameters
    ----------
    hair : float32 array (h, w, 4)
        Scene-linear light, already multiplied by coverage, and coverage in 0-1.

    Returns
    -------
    float32 array (h, w, 4)
    """
    light, cover = hair[..., :3], hair[..., 3]
    broken = (cover > 0) & (light.max(axis=-1) <= 0)
    whole = np.where(broken[..., None], 0, hair)
    counted = _neighbours((~broken).astype(np.float32)[..., None])
    about = _neighbours(whole) / np.maximum(counted, 1)
    out = np.where(broken[..., None], about, hair)
    colour = about[..., :3] / np.maximum(about[..., 3:], 1e-4)
    glare = light.sum(axis=-1) > GLINT * colour.sum(axis=-1) * np.maximum(cover, about[..., 3])
    glare &= about[..., 3] > ALONE
    out[..., :3] = np.where(glare[..., None], colour * cover[..., None], out[..., :3])
    return np.asarray(out, np.float32)


def without_dots(picture: Light, cover: Light) -> Light:
    """A picture of hair before skin without single dark pixels.

    Now and then Cycles calls a pixel wholly covered of which a hair covers a tenth: a dot of ink again, with
    some of the hair's light, that comes and goes from one closure to the next. Coverage distinguishes it from
    hair: judged by its light, every other pixel of a thin lash was a dot, and lashes were rows of specks.

    Parameters
    ----------
    picture : float32 array (h, w, 3)
        Scene-linear light.
    cover : float32 array (h, w)
        Share of each pixel that hair covers, 0 to 1.

    Returns
    -------
    float32 array (h, w, 3)
        A dot has the median light of the eight pixels about it; all others stay. The end of a hair that is
        covered to its last pixel, which has one covered neighbor too, loses that pixel.
    """
    about = np.stack(_shifted(np.pad(cover, 1, mode="reflect"), cover.shape))
    dots = (cover > DOT) & (np.partition(about, -2, axis=0)[-2] < SPARSE)
    light = np.stack(_shifted(np.pad(picture, ((1, 1), (1, 1), (0, 0)), mode="reflect"), picture.shape))
    out = picture.copy()
    out[dots] = np.median(light[:, dots], axis=0)
    return out


def _neighbours(picture: Light) -> Light:
    """Sum of the eight pixels about each; beyond the edges there is nothing."""
    padded = np.pad(picture, ((1, 1), (1, 1), (0, 0)))
    return np.asarray(sum(_shifted(padded, picture.shape)))


def _shifted(padded: Light, shape: tuple[int, ...]) -> list[Light]:
    """The picture moved by one pixel in each of eight directions, of one that is padded by one."""
    height, width = shape[:2]
    places = [(y, x) for y in range(3) for x in range(3) if (y, x) != (1, 1)]
    return [padded[y : y + height, x : x + width] for y, x in places]
