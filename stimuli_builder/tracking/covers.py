"""Which eyes are covered, told by what this person's own eyes look like over the recording.

A detector draws lids on a hand or a cloth too. What it draws on a cover must not train a model, which would
then fit covers as well as eyes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.tracking.shapes import EYE_POINTS, Points, eye_axis
from stimuli_builder.video import VideoInfo

Values = NDArray[np.float64]
Flags = NDArray[np.bool_]

ROWS, COLUMNS = 20, 28
HALF_WIDTH, ABOVE, BELOW = 0.7, 0.5, 0.4
"""What is looked at about the middle between the canthi, as parts of the eye's width: the mesh's border."""
UNLIKE = 0.6
"""Correlation with an eye's commonest look below which it is changed: covers have 0.54 or less, and so have
shut eyes."""
USUAL = 0.85
"""Correlation above which an eye looks as usual, or two looks are alike. While one eye is covered the other
has 0.94 or more, blinks aside."""
COVERED = "{} covered: {} itself neither open nor shut"
HALF = 0.5
"""Part of the looks at a changed eye that must resemble it shut, or it is covered."""
BRIEF_S = 0.4
"""An eye that changes alone for less than this, from first look to last, may blink; what it looks like then
is this eye shut. Where looks lie farther apart, two looks are asked for."""


@dataclass(frozen=True)
class Look:
    """What is seen of both eyes at one look.

    Attributes
    ----------
    time_s : float
        From the beginning of the recording.
    textures : float64 array (2, pixels)
        Grey levels about each eye, freed of its place, size and turn; mean 0, root mean square 1.
    """

    time_s: float
    textures: Values


def textures_of(picture: NDArray[np.uint8], points: Points) -> Values:
    """Grey levels about each eye (eyes, pixels), freed of place, size, turn, brightness and contrast.

    Parameters
    ----------
    picture : (h, w) or (h, w, 3) array
    points : (9 * eyes, 2) array
        Landmarks in its pixels.
    """
    eyes = [_sampled(picture, eye) for eye in points.reshape(-1, EYE_POINTS, 2)]
    levels = np.array([eye[_ellipse()] for eye in eyes], np.float64)
    levels -= levels.mean(1, keepdims=True)
    return np.asarray(levels / np.maximum(levels.std(1, keepdims=True), 1e-6))


def covered_frames(info: VideoInfo, textures: Mapping[int, Values], fewest: int) -> dict[int, str]:
    """Frames that show a covered eye, and that in words.

    Parameters
    ----------
    textures : dict of int to float64 array
        Frame that shows a face -> its `textures_of`.

    Raises
    ------
    InputError
        Fewer than `fewest` of them show both eyes.
    """
    numbers = sorted(textures)
    covers = covered_looks([Look(float(info.times_s[n]), textures[n]) for n in numbers])
    if len(numbers) - len(covers) < fewest:
        raise InputError(
            f"{info.path}: one eye is covered on {len(covers)} of {len(numbers)} frames that show a face, "
            "too few are left to track without labels; label frames by hand (--labels)"
        )
    return {numbers[look]: why for look, why in covers.items()}


def covered_looks(looks: Sequence[Look]) -> dict[int, str]:
    """Number of each look at which an eye is covered, and that in words; see `covered`."""
    words = ("left eye", "it looks like"), ("right eye", "it looks like"), ("both eyes", "neither looks like")
    flags = covered(looks)
    numbers = np.flatnonzero(flags.any(1)).tolist()
    return {n: COVERED.format(*words[2 if flags[n].all() else int(flags[n, 1])]) for n in numbers}


def covered(looks: Sequence[Look]) -> Flags:
    """Which eye is covered at which look, (looks, 2).

    An eye is odd while it is unlike its own commonest look and the other eye is as usual. Changed and odd for
    less than 0.4 s it may blink alone, and changed without being odd it blinks with the other one: looks like
    any of those are this eye shut. What lasts longer and is mostly unlike them is a cover, while the other
    eye blinks or is covered too. Which look is the eye, where it is odd for most of the recording, is told
    by the other eye's mirror image.
    """
    textures = np.array([look.textures for look in looks])
    times = np.array([look.time_s for look in looks])
    if not len(looks):
        return np.zeros((0, 2), np.bool_)
    likeness = np.stack([_likeness(textures[:, eye], _own(textures, eye, times)) for eye in (0, 1)], axis=1)
    return np.stack([_covered(textures[:, eye], likeness, eye, times) for eye in (0, 1)], axis=1)


def _usual(textures: Values) -> Values:
    """The commonest look of an eye (pixels,): the median of the looks like the one that most are like.

    The median of all would be a mixture of looks where there are several.
    """
    alike = textures @ textures.T / textures.shape[1] > USUAL
    np.fill_diagonal(alike, val=True)  # a plain cover has no texture and is like nothing
    return np.asarray(np.median(textures[alike[alike.sum(1).argmax()]], axis=0))


def _own(textures: Values, eye: int, times: Values) -> Values:
    """What an eye looks like (pixels,), where it is covered for most of the time too.

    Of its commonest look and others that last while the other eye is as usual, the one is the eye that is
    more like the other eye in a mirror.
    """
    one, beside = textures[:, eye], _usual(textures[:, 1 - eye])
    own = _usual(one)
    other = _likeness(textures[:, 1 - eye], beside) > USUAL
    mirror, likeness = _likeness(one, _mirrored(beside)), _likeness(one, own)
    common = other & (likeness > USUAL)
    best = float(mirror[common].mean()) if common.any() else 1.0
    for run in _runs(other & (likeness < UNLIKE)):
        seen = _usual(one[run])
        alike = run[_likeness(one[run], seen) > USUAL]
        if not alike.size or times[alike[-1]] - times[alike[0]] < BRIEF_S:
            continue
        if float(mirror[alike].mean()) > best:
            best, own = float(mirror[alike].mean()), seen
    return own


def _covered(textures: Values, likeness: Values, eye: int, times: Values) -> Flags:
    """At which looks one eye is covered (looks,)."""
    changed = likeness[:, eye] < UNLIKE
    odd = changed & (likeness[:, 1 - eye] > USUAL)
    lasting: list[NDArray[np.int64]] = []
    shut, covers = np.zeros_like(odd), np.zeros_like(odd)
    for run in _runs(changed):
        alone = [run[part] for part in _runs(odd[run])]
        if sum(float(times[part[-1]] - times[part[0]]) for part in alone) >= BRIEF_S:
            lasting.append(run)
        else:
            shut[run] = True
    for run in lasting:
        covers[run] = _like_any(textures[run[odd[run]]], textures[shut]).mean() < HALF
    return covers


def _like_any(textures: Values, others: Values) -> Flags:
    """Which textures (n, pixels) are like any of the others (m, pixels)."""
    if not len(others):
        return np.zeros(len(textures), np.bool_)
    return np.asarray((textures @ others.T / textures.shape[1]).max(1) > USUAL)


def _likeness(textures: Values, one: Values) -> Values:
    """Correlation of textures (n, pixels) with one (pixels,) that need not be normalised."""
    away = one - one.mean()
    return np.asarray(textures @ away / max(len(away) * float(away.std()), 1e-9))


def _runs(flags: Flags) -> list[NDArray[np.int64]]:
    """Numbers of the looks of each unbroken run of true flags."""
    numbers = np.flatnonzero(flags)
    return np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1) if len(numbers) else []


def _mirrored(texture: Values) -> Values:
    """A texture (pixels,) seen in a mirror."""
    whole = np.zeros((ROWS, COLUMNS))
    whole[_ellipse()] = texture
    return np.asarray(whole[:, ::-1][_ellipse()])


def _ellipse() -> Flags:
    """Which cells of the grid lie in the ellipse about the eye (rows, columns)."""
    x, y = np.linspace(-1, 1, COLUMNS), np.linspace(-ABOVE, BELOW, ROWS) / ABOVE
    return np.asarray(x[None, :] ** 2 + y[:, None] ** 2 <= 1)


def _sampled(picture: NDArray[np.uint8], eye: Points) -> Values:
    """Grey levels on a grid about an eye (rows, columns), each the mean of its cell."""
    along, down, width = eye_axis(eye)
    finer = max(1, int(np.ceil(2 * HALF_WIDTH * width / COLUMNS)))
    x = np.linspace(-HALF_WIDTH, HALF_WIDTH, finer * COLUMNS)[None, :, None]
    y = np.linspace(-ABOVE, BELOW, finer * ROWS)[:, None, None]
    grid = ((eye[0] + eye[5]) / 2 + width * (x * along + y * down)).astype(np.float32)
    remap: Any = cv2.remap
    fine = remap(picture, grid[..., 0], grid[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    cells = cv2.resize(fine.astype(np.float32), (COLUMNS, ROWS), interpolation=cv2.INTER_AREA)
    return np.asarray(cells if cells.ndim == 2 else cells.mean(2), np.float64)
