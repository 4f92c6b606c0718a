"""MediaPipe's iris network on a close-up: one eye, read in regions that are laid on it once."""

from collections.abc import Sequence

import numpy as np

from experiments.errors import InputError
from stimuli_builder.tracking.detector.detection import Detection, contour_spread, eye_points
from stimuli_builder.tracking.detector.eye_regions import SIDE_OF_WIDTH, Region, contours_of
from stimuli_builder.tracking.detector.face_mesh import LEAST_EYE_PX
from stimuli_builder.tracking.detector.mesh_client import MeshClient
from stimuli_builder.tracking.shapes import Points
from stimuli_builder.video import Picture

REGION_SIDES = (0.9, 1.2, 1.5, 1.9, 2.4)
"""Sides of the regions tried in a close-up, as parts of the picture's height."""
REGION_SHIFTS = (-0.18, 0.0, 0.18)
JITTERS = ((0, 0, 0.9), (0, 0, 1.1), (0.05, 0, 1.0), (0, 0.05, 1.0))
JITTERED = 4
"""Pictures in which the regions tried are jittered."""
LAID_ON = 9
"""Pictures over which the region is laid on the eye."""


def spread_out(pictures: Sequence[Picture], count: int) -> list[Picture]:
    """So many of the pictures, or all where they are fewer, from the first to the last and evenly apart."""
    chosen = np.linspace(0, len(pictures) - 1, min(count, len(pictures))).round()
    return [pictures[int(number)] for number in chosen]


class CloseUp:
    """One eye that fills the picture, read in regions that `look_for` lays on it once."""

    eyes = 1

    def __init__(self, client: MeshClient):
        self._client = client
        self._views: list[Region] = []

    def look_for(self, pictures: Sequence[Picture]) -> None:
        """Lay the regions on the eye.

        A first region is the one whose contour moves least when it is moved, and opens and closes most. Those
        that the eye is read in are laid, in two rounds, on the eye as they see it.

        Raises
        ------
        InputError
            The eye is seen less than 10 px wide.
        """
        height, width = pictures[0].shape[:2]
        regions = [
            Region(width / 2 + dx * width, height / 2 + dy * height, side * height, flip)
            for side in REGION_SIDES
            for dx in REGION_SHIFTS
            for dy in REGION_SHIFTS
            for flip in (False, True)
        ]
        spread = np.mean([self._spread(p, regions) for p in spread_out(pictures, JITTERED)], axis=0)
        best = np.argsort(spread)[:6]
        heights = np.array([self._heights(p, [regions[k] for k in best]) for p in pictures])
        low, high = np.percentile(heights, [3, 90], axis=0)
        travel = (high - low) / np.maximum(high, 1e-6)
        region = regions[int(best[int(np.argmax(travel - 2 * spread[best]))])]
        self._views = region.views(region.side / SIDE_OF_WIDTH)
        for _ in range(2):
            self._lay(spread_out(pictures, LAID_ON), region.flip)

    def _lay(self, pictures: Sequence[Picture], flip: bool) -> None:
        """Lay the views on the eye's middle, in the median of pictures, with sides by its width."""
        canthi = np.array([self._points(picture)[0][[0, 5]] for picture in pictures])
        width = float(np.median(np.hypot(*(canthi[:, 1] - canthi[:, 0]).T)))
        if width < LEAST_EYE_PX:
            raise InputError(
                f"the eye of this close-up is seen {width:.0f} px wide, and {LEAST_EYE_PX} are needed; "
                "leave out --one-eye if the video shows a face"
            )
        x, y = np.median(canthi.mean(1), axis=0).tolist()
        self._views = Region(x, y, SIDE_OF_WIDTH * width, flip).views(width)

    def _spread(self, picture: Picture, regions: Sequence[Region]) -> Points:
        """How far the canthi move, as part of the eye's width, when each region is jittered."""
        moved = [
            Region(x + dx * side, y + dy * side, side * scale, flip)
            for x, y, side, flip, _ in regions
            for dx, dy, scale in ((0, 0, 1.0), *JITTERS)
        ]
        answers = self._client.ask("eye", picture, regions=moved)["eyes"]
        canthi = np.array([(upper[0], upper[-1]) for upper, _, _ in answers])
        canthi = canthi.reshape(len(regions), len(JITTERS) + 1, 2, 2)
        width = np.hypot(*(canthi[:, 0, 1] - canthi[:, 0, 0]).T)
        away = np.sqrt(((canthi[:, 1:] - canthi[:, :1]) ** 2).sum(-1)).mean((1, 2))
        return np.asarray(away / np.maximum(width, 1e-6))

    def _heights(self, picture: Picture, regions: Sequence[Region]) -> list[float]:
        answers = self._client.ask("eye", picture, regions=list(regions))["eyes"]
        return [
            float(np.mean(np.array(lower)[3:6, 1]) - np.mean(np.array(upper)[3:6, 1]))
            for upper, lower, _ in answers
        ]

    def _points(self, picture: Picture) -> tuple[Points, Points, float]:
        """Nine points and the iris's five, the mean of all views, and the `contour_spread`."""
        eyes = self._client.ask("eye", picture, regions=self._views)["eyes"]
        spread = contour_spread(contours_of(eyes), self._views[0].side / SIDE_OF_WIDTH)
        up, low, iris = (np.mean([eye[part] for eye in eyes], axis=0) for part in range(3))
        # One-eye files begin at the image-left canthus, whichever that is.
        if up[0, 0] > up[-1, 0]:
            up, low = up[::-1], low[::-1]
        return eye_points(up, low[::-1]), iris, spread

    def detect(self, picture: Picture) -> list[Detection]:
        """Return the eye in the regions found before."""
        if not self._views:
            return []
        points, iris, spread = self._points(picture)
        box = np.concatenate([points.min(0), points.max(0)])
        return [Detection(points, iris[None], box, (spread,))]
