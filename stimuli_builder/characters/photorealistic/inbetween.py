"""Levels between rendered ones, moved along the lids' known displacement instead of cross-faded.

Each pixel of the level in between shows a point of lid, lash or eyeball whose place in both rendered
neighbours is known from the geometry: it is fetched from there, and the two are mixed in linear light by
nearness. A neighbour where the point is hidden is left out.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from stimuli_builder.characters.photorealistic.eyelid_skin import LidPose, build_skin
from stimuli_builder.characters.photorealistic.framing import Box, Frame
from stimuli_builder.characters.photorealistic.parameters import Face
from stimuli_builder.characters.photorealistic.visibility import EYE, LASH, Surface, View, surface, view

Light = NDArray[np.float32]


class Inbetweener:
    """Makes levels of one face; remembers the surfaces of the poses last asked for."""

    def __init__(self, face: Face, frame: Frame) -> None:
        self._face, self._frame = face, frame
        self._seen: dict[float, list[tuple[Surface, View]]] = {}

    def between(
        self, closure: float, below: float, above: float, light_below: Light, light_above: Light, origin: Box
    ) -> Light:
        """(h, w, 3) linear light at `closure` from two levels whose crop begins at `origin`'s corner."""
        self._seen = {w: seen for w, seen in self._seen.items() if w in (below, above)}
        share = np.float32((closure - below) / (above - below))
        result = (1 - share) * light_below + share * light_above
        for side, box in enumerate(self._frame.eye_boxes().values()):
            rows = slice(box[1] - origin[1], box[1] - origin[1] + box[3])
            columns = slice(box[0] - origin[0], box[0] - origin[0] + box[2])
            low, visible_low = self._fetch(closure, below, side, light_below[rows, columns])
            high, visible_high = self._fetch(closure, above, side, light_above[rows, columns])
            weight_low, weight_high = visible_low * (1 - share), visible_high * share
            moved = (low * weight_low + high * weight_high) / (weight_low + weight_high)
            fade = self._frame.feather(box)
            result[rows, columns] += fade * (moved - result[rows, columns])
        return np.asarray(np.maximum(result, 0), np.float32)

    def _fetch(self, closure: float, source: float, side: int, light: Light) -> tuple[Light, Light]:
        """The source's light moved to the pose of `closure`, and (h, w, 1) how far each point was visible."""
        (here, seen), (there, source_seen) = self._pose(closure)[side], self._pose(source)[side]
        points = np.maximum(seen.point, 0).ravel()
        moved = self._frame.project(there.points[points]) - self._frame.project(here.points[points])
        shift = np.where(seen.point[..., None] >= 0, moved.reshape(*seen.point.shape, 2), 0)
        shift = _smooth_within(shift.astype(np.float32), seen.kind)
        height, width = seen.point.shape
        rows, columns = np.mgrid[0:height, 0:width].astype(np.float32)
        x, y = columns + shift[..., 0], rows + shift[..., 1]
        fetched = cv2.remap(light, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        row = np.clip(np.round(y), 0, height - 1).astype(int)
        column = np.clip(np.round(x), 0, width - 1).astype(int)
        same = source_seen.kind[row, column] == seen.kind
        visible = np.where(seen.kind == LASH, 1.0, same).astype(np.float32)
        visible *= cv2.GaussianBlur(visible, (0, 0), 0.7)
        return np.asarray(fetched, np.float32), np.asarray(visible + 1e-4, np.float32)[..., None]

    def _pose(self, closure: float) -> list[tuple[Surface, View]]:
        """Surface and view of both sides, left first."""
        if closure not in self._seen:
            skin = build_skin(LidPose(closure))
            surfaces = [surface(self._face, skin, side) for side in (-1, 1)]
            boxes = self._frame.eye_boxes().values()
            self._seen[closure] = [(s, view(s, self._frame, b)) for s, b in zip(surfaces, boxes, strict=True)]
        return self._seen[closure]


def _smooth_within(shift: NDArray[np.float32], kind: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Even out the splats' rounding inside each kind; edges between kinds stay sharp, the eye stays still."""
    result = shift.copy()
    for one in np.unique(kind):
        if one not in (EYE, LASH):
            inside = (kind == one).astype(np.float32)
            weight = cv2.GaussianBlur(inside, (0, 0), 1.0)[..., None]
            even = cv2.GaussianBlur(shift * inside[..., None], (0, 0), 1.0) / np.maximum(weight, 1e-6)
            result = np.where(inside[..., None] > 0, even, result)
    return np.asarray(result, np.float32)
