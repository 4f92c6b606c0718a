"""Levels between rendered ones, moved rather than cross-faded.

Skin and lashes follow the optical flow between the two rendered neighbours (dense inverse search, Kroeger et
al. 2016, doi:10.1007/978-3-319-46493-0_29). The eyeball does not move, only the lid's shadow on it does:
there the neighbours' *shade*, their light over the open eye's, is shifted with the lid's margin, which the
geometry knows.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from stimuli_builder.characters.colour import linear_to_srgb
from stimuli_builder.characters.photorealistic.eyelid_skin import LidPose, build_skin
from stimuli_builder.characters.photorealistic.framing import Box, Frame
from stimuli_builder.characters.photorealistic.parameters import Face
from stimuli_builder.characters.photorealistic.visibility import EYE, UPPER_LID, Surface, View, surface, view

Light = NDArray[np.float32]
# The shadow's reach below the margin; light added to dark pupils so that shades stay bounded; their bound.
SHADOW_MM, DARKEST, BRIGHTEST_SHADE = 3.0, np.float32(0.03), np.float32(1.15)


@dataclass(frozen=True)
class Rendered:
    """A picture of a pose, (h, w, 3) linear light of the crop."""

    pose: LidPose
    light: Light


class Inbetweener:
    """Makes pictures of one face; remembers the surfaces of the poses it last used.

    `boxes` are the parts of the frame that move, left first; `crop` is what pictures cover; `still` is the
    open eye's picture, (h, w, 3) linear light: the eyeball as it looks wherever a lid uncovers it.
    """

    def __init__(self, face: Face, frame: Frame, boxes: dict[str, Box], crop: Box, still: Light) -> None:
        self._face, self._frame, self._crop = face, frame, crop
        self._boxes = list(boxes.values())
        self._still = still + DARKEST
        self._seen: dict[LidPose, list[tuple[Surface, View]]] = {}

    def mix(self, pose: LidPose, low: Rendered, high: Rendered, share: float) -> Light:
        """(h, w, 3) linear light of a pose that lies `share` (0-1) of the way from `low` to `high`."""
        kept = (low.pose, high.pose)
        self._seen = {known: seen for known, seen in self._seen.items() if known in kept}
        result = flow_mix(low.light, high.light, share)
        for side, box in enumerate(self._boxes):
            where = self._inside(box)
            shade = (1 - np.float32(share)) * self._shade(pose, low, side)
            shade += np.float32(share) * self._shade(pose, high, side)
            eye = (self._pose(pose)[side][1].kind == EYE).astype(np.float32)
            eye = np.clip(2 * cv2.GaussianBlur(eye, (0, 0), 1.0) - 1, 0, 1)[..., None] * self._frame.feather(
                box
            )
            result[where] += eye * (shade * self._still[where] - DARKEST - result[where])
        return np.asarray(np.maximum(result, 0), np.float32)

    def _inside(self, box: Box) -> tuple[slice, slice]:
        x, y = box[0] - self._crop[0], box[1] - self._crop[1]
        return slice(y, y + box[3]), slice(x, x + box[2])

    def _shade(self, pose: LidPose, source: Rendered, side: int) -> Light:
        """The source's light over the open eye's, shifted as the lid's shadow is from `source` to `pose`."""
        (here, seen), (there, _) = self._pose(pose)[side], self._pose(source.pose)[side]
        points = np.maximum(seen.point, 0).ravel()
        moved = self._frame.project(there.points[points]) - self._frame.project(here.points[points])
        where = self._inside(self._boxes[side])
        shade = np.minimum((source.light[where] + DARKEST) / self._still[where], BRIGHTEST_SHADE)
        height = moved[:, 1].reshape(seen.kind.shape).astype(np.float32)
        return _moved(shade, _shadow_shift(height, seen.kind, self._frame.px_per_mm))

    def _pose(self, pose: LidPose) -> list[tuple[Surface, View]]:
        """Surface and view of both sides, left first."""
        if pose not in self._seen:
            skin = build_skin(pose)
            surfaces = [surface(self._face, skin, side) for side in (-1, 1)]
            pairs = zip(surfaces, self._boxes, strict=True)
            self._seen[pose] = [(one, view(one, self._frame, box)) for one, box in pairs]
        return self._seen[pose]


def flow_mix(low: Light, high: Light, share: float) -> Light:
    """(h, w, 3) picture `share` of the way between two, each moved along the optical flow to the other."""
    grey = [cv2.cvtColor(linear_to_srgb(light), cv2.COLOR_RGB2GRAY) for light in (low, high)]
    search = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    search.setFinestScale(0)
    ahead = _at_share(search.calc(grey[0], grey[1], None), share)
    back = _at_share(search.calc(grey[1], grey[0], None), 1 - share)
    first, second = _moved(low, -share * ahead), _moved(high, -(1 - share) * back)
    return np.asarray((1 - np.float32(share)) * first + np.float32(share) * second, np.float32)


def _at_share(flow: Light, share: float, rounds: int = 6) -> Light:
    """The flow that each pixel in between carries: fixed point of u(p) = flow(p - share u(p))."""
    carried = flow
    for _ in range(rounds):
        carried = _moved(flow, -share * carried)
    return carried


def _moved(light: Light, shift: Light) -> Light:
    """Fetch each pixel from (h, w, 2) px further."""
    height, width = light.shape[:2]
    rows, columns = np.mgrid[0:height, 0:width].astype(np.float32)
    x, y = columns + shift[..., 0], rows + shift[..., 1]
    return np.asarray(cv2.remap(light, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE), np.float32)


def _shadow_shift(vertical: Light, kind: NDArray[np.uint8], px_per_mm: float) -> Light:
    """(h, w, 2) shift of the upper lid's shadow on the eyeball: the lid's at its margin, fading downwards."""
    height, width = kind.shape
    rows = np.arange(height)[:, None]
    margin = np.where(kind == UPPER_LID, rows, 0).max(0)
    at_margin = cv2.GaussianBlur(vertical[margin, np.arange(width)][None], (0, 0), 2.0)
    fade = np.exp(-((np.maximum(rows - margin, 0) / (SHADOW_MM * px_per_mm)) ** 2))
    result = np.zeros((height, width, 2), np.float32)
    result[..., 1] = fade * at_margin
    return result
