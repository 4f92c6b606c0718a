"""From a clip's curve to its pictures: blended in linear light, as planes ready for the encoder."""

from collections.abc import Iterator
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.blinks.profile import PROFILE_FPS
from stimuli_builder.clips.curves import Array, ClipCurve, samples_per_frame
from stimuli_builder.clips.kernels import GAMMA, blend, split_planes, to_yuv
from stimuli_builder.clips.levels import LevelSet, Picture
from stimuli_builder.clips.life import EyeRegions, Life, moments_of, noise_of

# Which samples of a 300 fps signal an output frame shows, and with what weight.


def frame_windows(sample_count: int, fps: float, blur: bool) -> Iterator[tuple[NDArray[np.int64], Array]]:
    """Yield for each output frame the samples of a signal that it shows, and their weights, which sum to 1.

    With blur a frame is the mean of the samples inside its time, the paper's average of ten (4.1.1):
    our frame k at 30 fps is at sample 10 k + 5 and averages 10 k ... 10 k + 9, five before and four
    after. Where a frame's time cuts a sample, the sample counts by its share. Without blur a frame is
    the sample at its time. The averaging itself must be done in linear light.

    Parameters
    ----------
    sample_count : int
        Length of the signal; frames that do not fit in wholly are left out.
    fps : float
        Rate of the output, 24 to 60.
    """
    step = samples_per_frame(fps)
    # 300 / 29.97 and its like leave a whole number of frames a rounding error short.
    frames = int(sample_count / step + 1e-9)
    if frames < 1:
        raise InputError(
            f"{sample_count} samples at {PROFILE_FPS} fps are less than one frame at {fps:g} fps"
        )
    for start in np.arange(frames) * step:
        if not blur:
            # A sample's number may come out a rounding error short as well.
            yield np.array([int(start + step / 2 + 1e-9)]), np.ones(1)
            continue
        # One sample more than may be needed: those without a share are left out below.
        sample = np.arange(int(start), min(sample_count, int(np.ceil(start + step)) + 1))
        # How much of each sample's own time, one 300th of a second, lies within the frame's.
        covered = np.clip(np.minimum(start + step, sample + 1) - np.maximum(start, sample), 0.0, 1.0)
        used = covered > 0
        yield sample[used], covered[used] / covered.sum()


def frame_weights(sample_count: int, fps: float, blur: bool) -> Array:
    """(frames, samples) weights of a short signal's samples, as `frame_windows` gives them one by one."""
    windows = list(frame_windows(sample_count, fps, blur))
    weights = np.zeros((len(windows), sample_count))
    for row, (samples, shares) in zip(weights, windows, strict=True):
        row[samples] = shares
    return weights


# The test barcode: a frame's number drawn in the picture, for tests that read back what was shown.
#
# Bottom-left corner, cells of 16 x 16 px from left to right: a white and a black guard cell, then 12 bits,
# least significant first; white is 1.

CELL_PX = 16
BITS = 12
WHITE_LUMA, BLACK_LUMA, GREY_CHROMA = 235, 16, 128


def cells(number: int) -> list[bool]:
    """White (True) and black cells of a frame number, guard cells first; numbers wrap at 4096."""
    return [True, False, *(bool(number >> bit & 1) for bit in range(BITS))]


def draw_barcode(
    luma: NDArray[np.uint8], blue: NDArray[np.uint8], red: NDArray[np.uint8], number: int
) -> None:
    """Draw a frame's number into 4:2:0 planes, in place."""
    pattern = cells(number)
    half = CELL_PX // 2
    for plane in (blue, red):
        plane[-half:, : half * len(pattern)] = GREY_CHROMA
    for index, white in enumerate(pattern):
        luma[-CELL_PX:, index * CELL_PX : (index + 1) * CELL_PX] = WHITE_LUMA if white else BLACK_LUMA


def read_barcode(luma: NDArray[np.uint8]) -> int | None:
    """The frame number in a decoded picture (height, width) of luma or gray; None where there is none."""
    middles = luma[luma.shape[0] - CELL_PX // 2, CELL_PX // 2 : CELL_PX * (BITS + 2) : CELL_PX]
    white = middles > 125
    if not (white[0] and not white[1]):
        return None
    return int(sum(1 << bit for bit in range(BITS) if white[2 + bit]))


Planes = NDArray[np.uint8]
LUMA_SHARES = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""BT.709."""
PAINTED_KEPT = 16
"""Pictures a painter keeps, so that resting frames are painted once however long the clip is."""
SEAM_MM = 4.0
"""Where the eyes move apart, the picture changes over from one to the other within this width."""


class FramePainter:
    """Paints the frames of clips of one character at one size."""

    def __init__(self, character: LevelSet) -> None:
        self.character = character
        self._base = character.base_planes

    def frames(
        self, curve: ClipCurve, fps: float, blur: bool, barcode: bool = False, life: Life | None = None
    ) -> Iterator[Planes]:
        """Yield each frame as a (height * 3 / 2, width) array of 4:2:0 planes, to be read only.

        A picture that rests is one array, yielded again for each of its frames; with `life` none rests.
        """
        if curve.lower_vertical_mm is not None and self.character.read_lower is None:
            raise InputError(
                f"character '{self.character.name}' has no lower-lid layer: use lower_lid = 'none'"
            )
        width, height = self.character.size_px
        painted: dict[bytes, Planes] = {}
        for number, (samples, weights) in enumerate(frame_windows(len(curve.closure), fps, blur)):
            if life is not None:
                alive = self._paint_alive(curve, samples, weights, life, number)
                yield _numbered(alive, width, height, number) if barcode else alive
                continue
            key = same_picture(curve, samples, weights)
            picture = painted.pop(key, None)
            if picture is None:
                picture = self._paint(curve, samples, weights)
                picture.flags.writeable = False
            # The picture shown last is the last to be forgotten.
            painted[key] = picture
            if len(painted) > PAINTED_KEPT:
                painted.pop(next(iter(painted)))
            yield _numbered(picture, width, height, number) if barcode else picture

    def light(self, curve: ClipCurve, samples: NDArray[np.int64], weights: NDArray[np.float64]) -> Picture:
        """(h, w, 3) linear light (of 65535) of the window: weighted mean over samples of the curve."""
        light = eye_light(self.character, curve, curve.closure, samples, weights)
        if curve.closure_other is None:
            return light
        # The participant sees the character's left eye at the right; `closure` is the left eye's.
        other = eye_light(self.character, curve, curve.closure_other, samples, weights)
        left_eye = self._seam()[None, :, None]
        return np.asarray(left_eye * light + (1 - left_eye) * other, np.float32)

    def _paint(self, curve: ClipCurve, samples: NDArray[np.int64], weights: NDArray[np.float64]) -> Planes:
        character, window = self.character, self.character.window
        width, height = character.size_px
        planes = self._base.copy()
        # Nothing moves: the base is converted already.
        if not np.any(curve.motion(samples)):
            return planes
        luma, blue, red = split_planes(planes, width, height)
        rows, columns = window.slices
        half_rows = slice(window.y // 2, (window.y + window.height) // 2)
        half_columns = slice(window.x // 2, (window.x + window.width) // 2)
        first_column = blue[half_rows, half_columns.start].copy(), red[half_rows, half_columns.start].copy()
        to_yuv(
            self.light(curve, samples, weights),
            GAMMA,
            luma[rows, columns],
            blue[half_rows, half_columns],
            red[half_rows, half_columns],
        )
        if window.x > 0:
            # This chroma column also weighs a luma column outside the window; nothing moves at the edge.
            blue[half_rows, half_columns.start], red[half_rows, half_columns.start] = first_column
        return planes

    def _paint_alive(
        self,
        curve: ClipCurve,
        samples: NDArray[np.int64],
        weights: NDArray[np.float64],
        life: Life,
        number: int,
    ) -> Planes:
        character, regions = self.character, self.eye_regions
        width, height = character.size_px
        whole = np.zeros((height, width, 3), np.float32)
        for part, part_weights, share in moments_of(life, samples, weights, character.px_per_mm):
            picture = character.base.astype(np.float32)
            picture[character.window.slices] = self.light(curve, part, part_weights)
            whole += np.float32(share) * regions.warped(picture, regions.moved_from(life, part, part_weights))
        planes = np.empty((height * 3 // 2, width), np.uint8)
        luma, blue, red = split_planes(planes, width, height)
        to_yuv(whole, GAMMA, luma, blue, red)
        luma[:] = np.clip(np.rint(luma + noise_of(life, number, luma.shape)), BLACK_LUMA, WHITE_LUMA)
        return planes

    @cached_property
    def eye_regions(self) -> EyeRegions:
        """Where the character's eyes lie."""
        return regions_of(self.character)

    def _seam(self) -> Picture:
        window = self.character.window
        from_middle = np.arange(window.x, window.x + window.width) + 0.5 - self.character.size_px[0] / 2
        share = from_middle / (SEAM_MM * self.character.px_per_mm) + 0.5
        return np.asarray(np.clip(share, 0.0, 1.0), np.float32)


def regions_of(character: LevelSet) -> EyeRegions:
    """Where a character's eyes lie in its frame, at its size."""
    shown = [np.array(character.base, np.float32) for _ in range(2)]
    for picture, level in zip(shown, (character.levels[0], character.levels[-1]), strict=True):
        picture[character.window.slices] = level
    opened, closed = (GAMMA[picture.astype(np.uint16)] @ LUMA_SHARES for picture in shown)
    return EyeRegions.of_pictures(opened, closed, character.px_per_mm)


def _numbered(picture: Planes, width: int, height: int, number: int) -> Planes:
    """A copy with the barcode of a frame's number."""
    planes = picture.copy()
    draw_barcode(*split_planes(planes, width, height), number)
    return planes


def eye_light(
    character: LevelSet,
    curve: ClipCurve,
    closure: NDArray[np.float64],
    samples: NDArray[np.int64],
    weights: NDArray[np.float64],
) -> Picture:
    """(h, w, 3) linear light (of 65535) of the window where both eyes follow one signal of the curve."""
    # Linear in light, so the mean over the shutter's time is one set of weights over levels.
    level_weights = weights @ character.level_weights(closure[samples])
    # Less than a hundredth of a 16-bit step in any pixel.
    chosen = np.flatnonzero(level_weights > 1e-7)
    flat = character.levels.reshape(len(character.levels), -1)
    light = np.empty(flat.shape[1], np.float32)
    blend(flat, chosen, level_weights[chosen].astype(np.float32), light)
    picture: Picture = light.reshape(character.levels.shape[1:])
    vertical, horizontal = curve.lower_vertical_mm, curve.lower_horizontal_mm
    if character.read_lower is not None and vertical is not None and horizontal is not None:
        character.lower.add(picture, weights, closure[samples], vertical[samples], horizontal[samples])
    return picture


def same_picture(curve: ClipCurve, samples: NDArray[np.int64], weights: NDArray[np.float64]) -> bytes:
    """Equal for frames that look alike: resting frames are painted once."""
    motion = curve.motion(samples)
    if np.all(motion == motion[:, :1]):
        return motion[:, 0].tobytes()
    # Rounded, as the weights of equal frames differ in the last digits by where in the clip they are.
    return motion.tobytes() + np.round(weights, 12).tobytes()
