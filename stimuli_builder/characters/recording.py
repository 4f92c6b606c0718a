"""Frames of a recorded blink for a character, chosen by closure and gaze, without head motion, in even light.

A blink's opening is slower than its closing, so its frames lie closer together and are less blurred. The
levels come from one opening, from the last frame that is shut to the most open one after it.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError, counted
from stimuli_builder.tracking.iris import IRIS_MM, Iris, measure_iris
from stimuli_builder.tracking.shapes import (
    CANTHI,
    EYE_POINTS,
    Points,
    eye_axis,
    similarity_between,
    with_border,
)
from stimuli_builder.tracking.table import distance_columns, numbers, point_columns, track_rows
from stimuli_builder.video import Picture, VideoInfo, decode

Values = NDArray[np.float64]
Image = NDArray[np.float32]
"""(h, w, 3) sRGB code values, not rounded."""
Flags = NDArray[np.bool_]

LUMA: NDArray[np.float32] = np.array([0.299, 0.587, 0.114], np.float32)

# What a track says: closure, blinks and where the eyes look.

DEEPEST_SHARE = 0.25
"""A tracked opening that never gets below this share of the open eye is not a full closure."""
SHUT = 0.94
"""A blink that gets no deeper is partial."""
STILL_SHUT = 0.015
"""The last frame this near to a blink's deepest closure is its shut one."""
OPEN_AGAIN_S = 0.7
"""An eye needs up to so long after a blink until it is as open as before."""
WIDEST_GAP = 0.4
"""Frames of one opening may be so far apart in closure, else nothing but a guess lies in between."""
LEAST_STEP = 0.008
"""Frames nearer than this to one another in closure show the same."""
EYES_DIFFER = 0.15
LOOKS_AWAY = 0.10
"""Iris from the middle of its eye, as a share of the eye's width (3 mm, or 15 degrees)."""


@dataclass(frozen=True, eq=False)
class EyeTrack:
    """A track of a video, and the closures that follow.

    Attributes
    ----------
    points : float64 array (n, 9 * eyes, 2)
        NaN where the eyes were lost.
    distance_px : float64 array (n, eyes)
    open_px, shut_px : float64 array (eyes,)
        Tracked opening of the open and of the shut eye.
    """

    points: Points
    distance_px: Values
    open_px: Values
    shut_px: Values

    @property
    def eyes(self) -> int:
        """One or two."""
        return int(self.distance_px.shape[1])

    @property
    def closures(self) -> Values:
        """(n, eyes) share of the opening that is closed; NaN where lost."""
        return np.asarray(1 - (self.distance_px - self.shut_px) / (self.open_px - self.shut_px))

    def eye_points(self, frame: int) -> Points:
        """(eyes, 9, 2) points of a frame."""
        return np.asarray(self.points[frame].reshape(-1, EYE_POINTS, 2))

    @property
    def width_px(self) -> float:
        """Median width of the eyes."""
        eyes = self.points.reshape(len(self.points), -1, EYE_POINTS, 2)
        span = eyes[:, :, CANTHI[1]] - eyes[:, :, CANTHI[0]]
        return float(np.nanmedian(np.hypot(span[..., 0], span[..., 1])))


def read_eye_track(path: Path, info: VideoInfo, one_eye: bool) -> EyeTrack:
    """Read a track and check that it belongs to the video and shows full blinks.

    Raises
    ------
    InputError
        It is the track of another video, has another number of eyes, or no eye ever closes.
    """
    rows = list(track_rows(path))
    eyes = 2 if rows and "x18" in rows[0] else 1
    if (eyes == 1) != one_eye:
        fix = "add --one-eye" if eyes == 1 else "remove --one-eye"
        raise InputError(f"{path}: this is a track of {counted(eyes, 'eye')}; {fix}")
    if len(rows) != info.frame_count:
        raise InputError(
            f"{path}: {len(rows)} frames, but {info.path.name} has {info.frame_count}; use the track of this "
            "video"
        )
    points = np.array([numbers(row, point_columns(eyes), str(path)) for row in rows]).reshape(
        len(rows), -1, 2
    )
    distance = np.array([numbers(row, distance_columns(eyes), str(path)) for row in rows])
    if not (
        np.nanmin(points) >= -0.5 * max(info.size_px)
        and (np.nanmax(points, (0, 1)) < 1.5 * np.array(info.size_px)).all()
    ):
        raise InputError(
            f"{path}: its points are outside the picture of {info.size_px[0]} x {info.size_px[1]} pixels; "
            "use the track of this video"
        )
    # Median of what is near the widest: a single wide frame does not decide.
    opened = np.nanmedian(
        np.where(distance > 0.75 * np.nanpercentile(distance, 90, axis=0), distance, np.nan), 0
    )
    # A few frames lie below it: a single false one does not decide.
    shut = np.nanpercentile(distance, min(50.0, 300 / len(rows)), axis=0)
    if (shut > DEEPEST_SHARE * opened).any():
        deepest = 1 - float((shut / opened).max())
        raise InputError(
            f"{path}: no eye closes fully, the deepest closure is {deepest:.2f}; record full blinks, or "
            "correct the track with labels of shut frames"
        )
    return EyeTrack(points, distance, opened, shut)


@dataclass(frozen=True)
class Opening:
    """One blink's opening: frames from the last shut one to the most open one, both included."""

    shut: int
    opened: int
    gap: float

    @property
    def frames(self) -> range:
        """Numbers of all its frames."""
        return range(self.shut, self.opened + 1)


def closing_events(closure: Values) -> list[tuple[int, int]]:
    """First and last frame of each run that is more than half shut."""
    # With False at either end, so that a run which reaches it has two edges.
    shut = np.concatenate([[False], closure > 0.5, [False]])
    edges = np.flatnonzero(shut[1:] != shut[:-1])
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def find_openings(track: EyeTrack, info: VideoInfo) -> tuple[list[Opening], Counter[str]]:
    """Openings of which a character can be made, the densest first, and why others cannot be used.

    Returns
    -------
    list of Opening, and Counter of reasons.
    """
    closures = track.closures
    closure = closures.mean(1)
    events = closing_events(closure)
    good: list[Opening] = []
    refused: Counter[str] = Counter()
    for number, (first, last) in enumerate(events):
        limit = min(len(closure) - 1, last + round(OPEN_AGAIN_S * info.fps))
        if number + 1 < len(events):
            # At most half way to the next blink, whose frames are not part of this opening.
            limit = min(limit, (last + events[number + 1][0]) // 2)
        deepest = float(closure[first : last + 1].max())
        if deepest < SHUT:
            refused["the eye does not close fully"] += 1
            continue
        shut = first + int(np.flatnonzero(closure[first : last + 1] >= deepest - STILL_SHUT)[-1])
        after = closure[shut : limit + 1]
        if np.isnan(after).any() or len(after) < 3 or after.min() > 0.15:
            refused["it is cut off, or the eyes are lost"] += 1
            continue
        # The first frame that is nearly as open as the most open one: after it the head only moves on.
        opened = shut + int(np.flatnonzero(after <= after.min() + 0.01)[0])
        if track.eyes == 2 and np.median(np.abs(np.diff(closures[shut : opened + 1], axis=1))) > EYES_DIFFER:
            refused["the two eyes do not close together"] += 1
            continue
        # Where the lid falls back on its way, the least closure so far counts.
        path = np.minimum.accumulate(closure[shut : opened + 1])
        gap = float(-np.diff(path).min())
        if gap > WIDEST_GAP:
            refused[f"its frames are up to {gap:.2f} apart in closure"] += 1
            continue
        good.append(Opening(shut, opened, gap))
    return sorted(good, key=lambda opening: opening.gap), refused


def gaze_of(picture: Picture, track: EyeTrack, frame: int) -> Values | None:
    """(2,) mean place of the irises in their eyes, in eye widths from the middle; None where unseen."""
    places = []
    for eye in track.eye_points(frame):
        iris = measure_iris(picture, eye)
        if iris is not None:
            along, down, width = eye_axis(eye)
            away = np.array([iris.x, iris.y]) - (eye[CANTHI[0]] + eye[CANTHI[1]]) / 2
            places.append([away @ along / width, away @ down / width])
    return np.mean(places, axis=0) if places else None


WIDENED = 1.2
"""A detector draws the lids of a wide eye in a close-up by up to a fifth too near to one another. Looked for
within them, the iris is taken for a smaller circle."""


def widened_iris(picture: Picture, eye: Points) -> Iris | None:
    """Find the iris of an open eye (9, 2) beyond the detected lids."""
    middle = eye.mean(0)
    return measure_iris(picture, middle + WIDENED * (eye - middle))


def iris_scale(pictures: Mapping[int, Picture], track: EyeTrack) -> float | None:
    """Pixels per mm if an iris is 11.7 mm wide; None where none is seen.

    Parameters
    ----------
    pictures : mapping of int to uint8 array (h, w)
        Gray pictures of some frames.
    """
    diameters = []
    for number, picture in pictures.items():
        for eye in track.eye_points(number):
            iris = widened_iris(picture, eye)
            if iris is not None:
                diameters.append(iris.diameter)
    # The median, since in single frames the edge that is found is that of a lid or the pupil.
    return float(np.median(diameters)) / IRIS_MM if diameters else None


# Decoding what is needed: whole pictures of single frames, and the region about the eyes of others.

WIDTH_MM = {1: 64.0, 2: 128.0}
"""What a character's frame shows across, by the number of eyes; the shipped characters show 128 mm."""
SIDES = {1: (16, 12), 2: (16, 6)}
LARGEST_PX = 960


@dataclass(frozen=True)
class Region:
    """The part of the video that becomes the character's frame.

    Attributes
    ----------
    x, y, width, height : int
        In pixels of the video.
    size_px : (int, int)
        Width and height of the character's frame; smaller than the part where that is large.
    """

    x: int
    y: int
    width: int
    height: int
    size_px: tuple[int, int]

    @property
    def scale(self) -> float:
        """Pixels of the character per pixel of the video."""
        return self.size_px[0] / self.width

    def cut(self, picture: NDArray[Any]) -> Image:
        """The region of a whole picture at the character's size, as float32 (h, w, 3)."""
        part = picture[self.y : self.y + self.height, self.x : self.x + self.width].astype(np.float32)
        if part.shape[1::-1] != self.size_px:
            part = cv2.resize(part, self.size_px, interpolation=cv2.INTER_AREA)
        return part if part.ndim == 3 else np.repeat(part[..., None], 3, axis=2)

    def points(self, points: Points) -> Points:
        """Points of the video in pixels of the region."""
        # Pixel centers are whole numbers, so that the picture begins at -1/2.
        return np.asarray((points - [self.x, self.y] + 0.5) * self.scale - 0.5)


def region_of(points: Points, info: VideoInfo, px_per_mm: float) -> Region:
    """The region about the eyes of one frame, within the picture.

    Parameters
    ----------
    points : float64 array (9 * eyes, 2)
    px_per_mm : float
        Of the video.
    """
    eyes = len(points) // EYE_POINTS
    middle = points.mean(0)
    # Sides are whole multiples of these, so that every size of clip has even sides.
    across, down = SIDES[eyes]
    parts = int(min(WIDTH_MM[eyes] * px_per_mm, info.size_px[0]) / across)
    parts = min(parts, info.size_px[1] // down)
    width, height = parts * across, parts * down
    x = int(np.clip(round(middle[0] - width / 2), 0, info.size_px[0] - width))
    y = int(np.clip(round(middle[1] - height * 0.5), 0, info.size_px[1] - height))
    size = (width, height)
    if width > LARGEST_PX:
        size = (LARGEST_PX, LARGEST_PX // across * down)
    return Region(x, y, width, height, size)


def read_selected(
    info: VideoInfo,
    chosen: Sequence[int],
    read: Callable[[Any], NDArray[Any]],
    advance: Callable[[int], None],
) -> dict[int, NDArray[Any]]:
    """Decode the video once and keep `read` of the chosen frames."""
    numbers_left, kept = set(chosen), {}

    def read_chosen(frame: Any) -> Any:
        number = counter["frames"]
        counter["frames"] += 1
        return read(frame) if number in numbers_left else None

    counter = {"frames": 0}
    for number, (_, picture) in enumerate(decode(info.path, read_chosen)):
        if picture is not None:
            kept[number] = picture
        advance(number + 1)
        if len(kept) == len(numbers_left):
            break
    return kept


def gray_codes(picture: Image) -> Picture:
    """Luma of code values, as uint8 (h, w)."""
    return np.asarray(np.clip(picture @ LUMA + 0.5, 0, 255), np.uint8)


# One opening's pictures: aligned on what a blink leaves still, under the light of the open frame.

STILL_MARGIN = 1.15
"""The eyes' surroundings reach as far as the border of the tracker's mesh, and a little more."""
SMOOTH_S = 0.03
"""A head moves smoothly over this time; the rest of a measured motion is error."""
FILTER_PX = 5
SHEAR = 0.035
"""Rows of a rolling shutter are exposed one after another: a picture that shears more than this shows it."""
SHEAR_LOOKS = 6
BROW_UP, BROW_ACROSS = 1.5, 0.75
"""Brows sink in a blink: skin so far above an eye and to its sides, in eye widths, is not still."""
SURE = 0.97
"""Correlation of a registration above which no second start is tried."""


@dataclass(frozen=True, eq=False)
class StillFrames:
    """Frames of one opening without head motion, from open to shut.

    Attributes
    ----------
    numbers : list of int
        Frames of the video; the first is the open one, which all others are aligned on.
    closures : float64 array (n,)
        As tracked, or once the frames are distinct ascending, 0 for the first and 1 for the last.
    pictures : list of float32 array (h, w, 3)
    points : float64 array (n, 9 * eyes, 2)
        Aligned landmarks in pixels of the region.
    head_mm, light : float64 arrays (m,)
        Of every frame of the opening, measured and removed: displacement, and brightness relative to the open
        frame.
    shear : float
        Largest shear of the picture; removed if it is above `SHEAR`.
    still_db : float64 array (m,)
        How alike the surroundings are afterwards.
    """

    numbers: list[int]
    closures: Values
    pictures: list[Image]
    points: Points
    head_mm: Values
    light: Values
    shear: float
    still_db: Values
    region: Region = field(repr=False)

    def only(self, kept: Sequence[int], closures: Values) -> "StillFrames":
        """The same with some of the frames; what was measured of all frames stays."""
        return replace(
            self,
            numbers=[self.numbers[k] for k in kept],
            closures=closures[kept],
            pictures=[self.pictures[k] for k in kept],
            points=self.points[kept],
        )

    def without(self, k: int) -> "StillFrames":
        """The same without one frame."""
        return self.only([n for n in range(len(self.numbers)) if n != k], self.closures)


LEAST_STILL = 0.08


def still_mask(points: Points, size_px: tuple[int, int]) -> NDArray[np.uint8]:
    """255 where a blink leaves the picture still: away from eyes, lids and, if enough is left, brows."""
    mask = np.full(size_px[::-1], 255, np.uint8)
    for eye in points.reshape(-1, EYE_POINTS, 2):
        border = with_border(eye)[EYE_POINTS:]
        middle = border.mean(0)
        hull = (middle + STILL_MARGIN * (border - middle)).round().astype(np.int32)
        cv2.fillConvexPoly(mask, hull, 0)
    without_brows = mask.copy()
    for eye in points.reshape(-1, EYE_POINTS, 2):
        along, down, width = eye_axis(eye)
        canthi = (eye[CANTHI[0]] + eye[CANTHI[1]]) / 2
        corners = [(-BROW_ACROSS, 0), (BROW_ACROSS, 0), (BROW_ACROSS, -BROW_UP), (-BROW_ACROSS, -BROW_UP)]
        brow = np.array([canthi + width * (x * along + y * down) for x, y in corners])
        cv2.fillConvexPoly(without_brows, brow.round().astype(np.int32), 0)
    return without_brows if (without_brows > 0).mean() >= 2 * LEAST_STILL else mask


def align_opening(
    pictures: Mapping[int, NDArray[np.uint8]],
    track: EyeTrack,
    opening: Opening,
    info: VideoInfo,
    region: Region,
    px_per_mm: float,
    advance: Callable[[], None],
) -> StillFrames:
    """Align all frames of an opening on its open one and even out their light.

    Parameters
    ----------
    pictures : mapping of int to uint8 array (height, width, 3)
        Whole pictures of every frame of the opening.
    px_per_mm : float
        Of the region.

    Raises
    ------
    InputError
        Too little of the picture rests to align the frames on.
    """
    base = opening.opened
    mask = still_mask(region.points(track.points[base]), region.size_px)
    if (mask > 0).mean() < LEAST_STILL:
        raise InputError(
            f"{info.path}: the eyes fill the picture, so that head motion cannot be measured; leave more "
            "skin around them"
        )
    target = region.cut(pictures[base])
    shear = _largest_shear(pictures, track, opening, region, mask)
    matrices = _head_motion(pictures, track, opening, region, mask, shear > SHEAR, advance)
    # Odd, so that the window has a middle.
    window = max(1, round(SMOOTH_S * info.fps)) | 1
    matrices = _smoothed_in_time(matrices, window)
    moved, measures = {}, {}
    for number, matrix in zip(opening.frames, matrices, strict=True):
        still = _warped(region.cut(pictures[number]), matrix)
        evened, brightness = _evened(still, target, mask)
        moved[number] = evened
        away = matrix @ [region.size_px[0] / 2, region.size_px[1] / 2, 1] - np.array(region.size_px) / 2
        error = float(((evened - target)[mask > 0] ** 2).mean())
        measures[number] = (
            float(np.hypot(*away)) / px_per_mm,
            brightness,
            decibels(error),
        )
    chosen = list(reversed(opening.frames))
    # Matrices lead from the open frame to the others, and points go the other way.
    points = np.array(
        [
            cv2.transform(
                region.points(track.points[n])[None],
                cv2.invertAffineTransform(matrices[n - opening.shut]),
            )[0]
            for n in chosen
        ]
    )
    head_mm, light, still_db = np.array([measures[n] for n in opening.frames]).T
    pictures_moved, closures = [moved[n] for n in chosen], track.closures.mean(1)[chosen]
    return StillFrames(chosen, closures, pictures_moved, points, head_mm, light, shear, still_db, region)


def decibels(squared_error: float) -> float:
    """Peak signal-to-noise ratio of 8-bit code values."""
    return float(10 * np.log10(255**2 / max(squared_error, 1e-6)))


def distinct_frames(frames: StillFrames, closures: Values) -> StillFrames:
    """The frames that differ in closure, with closures from 0 to 1.

    Parameters
    ----------
    closures : float64 array (n,)
        Of all frames, from open to shut.
    """
    # Where the lid falls back on its way, the least closure so far counts.
    path = np.minimum.accumulate(closures[::-1])[::-1]
    path = (path - path[0]) / (path[-1] - path[0])
    kept = [0]
    for k in range(1, len(path) - 1):
        if path[kept[-1]] + LEAST_STEP <= path[k] <= 1 - LEAST_STEP:
            kept.append(k)
    return frames.only([*kept, len(path) - 1], path)


def _largest_shear(
    pictures: Mapping[int, NDArray[np.uint8]],
    track: EyeTrack,
    opening: Opening,
    region: Region,
    mask: NDArray[np.uint8],
) -> float:
    """Range of the shear over some frames of an opening."""
    target = gray_codes(region.cut(pictures[opening.opened]))
    shears = [0.0]
    for number in np.linspace(opening.shut, opening.opened - 1, SHEAR_LOOKS).astype(int).tolist():
        start = _by_canthi(track, region, opening.opened, number)
        fit = _registered(target, gray_codes(region.cut(pictures[number])), start, mask, sheared=True)
        if fit is not None:
            # A turn has opposite signs in these two places and cancels.
            shears.append(float(fit[1][0, 1] + fit[1][1, 0]))
    return float(np.ptp(shears))


def _head_motion(
    pictures: Mapping[int, NDArray[np.uint8]],
    track: EyeTrack,
    opening: Opening,
    region: Region,
    mask: NDArray[np.uint8],
    sheared: bool,
    advance: Callable[[], None],
) -> list[Values]:
    """(2, 3) matrices from the open frame to each frame, found backward in time from the open one."""
    base = opening.opened
    target = gray_codes(region.cut(pictures[base]))
    known = np.eye(2, 3)
    matrices = {base: known}
    for number in reversed(opening.frames[:-1]):
        picture = gray_codes(region.cut(pictures[number]))
        fit = _registered(target, picture, known, mask, sheared)
        if fit is None or fit[0] < SURE:
            other = _registered(target, picture, _by_canthi(track, region, base, number), mask, sheared)
            fit = max((one for one in (fit, other) if one is not None), key=lambda one: one[0], default=None)
        # Where neither fits, the head is taken to be where it was in the frame tried before.
        if fit is not None:
            known = fit[1]
        matrices[number] = known
        advance()
    return [matrices[number] for number in opening.frames]


def _registered(
    target: Picture, picture: Picture, start: Values, mask: Picture, sheared: bool
) -> tuple[float, Values] | None:
    # The enhanced correlation coefficient is blind to brightness and contrast (Evangelidis & Psarakis 2008).
    motion = cv2.MOTION_AFFINE if sheared else cv2.MOTION_EUCLIDEAN
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 60, 1e-5)
    try:
        likeness, matrix = cv2.findTransformECC(
            target, picture, start.astype(np.float32), motion, stop, mask, FILTER_PX
        )
    # OpenCV raises where the search does not converge.
    except cv2.error:
        return None
    return float(likeness), np.asarray(matrix, np.float64)


def _by_canthi(track: EyeTrack, region: Region, base: int, number: int) -> Values:
    """A first guess of the head's motion: the canthi as tracked."""
    ends = [EYE_POINTS * eye + end for eye in range(track.eyes) for end in CANTHI]
    a, b, x, y = similarity_between(
        region.points(track.points[base][ends]), region.points(track.points[number][ends])
    )
    return np.array([[a, -b, x], [b, a, y]])


def _smoothed_in_time(matrices: Sequence[Values], window: int) -> list[Values]:
    """Each matrix averaged over a window in time, narrower toward both ends: the open frame stays."""
    stack = np.array(matrices)
    half = window // 2
    smooth = stack.copy()
    for k in range(len(stack)):
        reach = min(half, k, len(stack) - 1 - k)
        if reach:
            smooth[k] = stack[k - reach : k + reach + 1].mean(0)
    return list(smooth)


def _warped(picture: Image, matrix: Values) -> Image:
    return np.asarray(
        cv2.warpAffine(
            picture,
            matrix,
            picture.shape[1::-1],
            flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        ),
        np.float32,
    )


def _evened(picture: Image, target: Image, mask: NDArray[np.uint8]) -> tuple[Image, float]:
    """The picture in the light of the target, and its mean brightness relative to the target before.

    The ratio of both, which varies by a plane over the picture, is fitted per channel where nothing moves.
    """
    height, width = mask.shape
    cell = max(4, min(height, width) // 24)
    small = (width // cell, height // cell)
    share = cv2.resize((mask > 0).astype(np.float32), small, interpolation=cv2.INTER_AREA)
    rows, columns = np.nonzero(share > 0.95)
    terms = np.column_stack([np.ones(len(rows)), columns / small[0] - 0.5, rows / small[1] - 0.5])
    now, then = (
        cv2.resize(one, small, interpolation=cv2.INTER_AREA)[rows, columns] for one in (picture, target)
    )
    # Nearly black or overexposed places say nothing of a ratio.
    lit = ((now > 8) & (now < 245) & (then > 8) & (then < 245)).all(1)
    if lit.sum() < 3 * terms.shape[1]:
        return picture, 1.0
    ratio = np.log(np.maximum(then, 1) / np.maximum(now, 1))
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    field_of = np.stack([np.ones_like(x), x / width - np.float32(0.5), y / height - np.float32(0.5)])
    gains = []
    for channel in range(3):
        good = lit.copy()
        # The second and third rounds leave out what does not fit the plane before.
        for _ in range(3):
            plane = np.linalg.lstsq(terms[good], ratio[good, channel], rcond=None)[0]
            rest = np.abs(ratio[:, channel] - terms @ plane)
            good = lit & (rest <= 2.5 * np.median(rest[lit]) + 1e-4)
        gains.append(np.exp(np.tensordot(plane.astype(np.float32), field_of, 1)))
    gain = np.stack(gains, axis=2)
    return np.asarray(picture * gain, np.float32), float(1 / np.exp(np.log(gain).mean()))
