"""The detector that ships: MediaPipe's face mesh with refined lids, or its iris network on a close-up."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from experiments.errors import InputError
from stimuli_builder.tracking.detector.detection import Detection, LidDetector, eye_points
from stimuli_builder.tracking.detector.mesh_client import MeshClient, detector_environment
from stimuli_builder.tracking.shapes import Points, eye_axis
from stimuli_builder.video import Picture

LEAST_EYE_PX = 10
FACES_ASKED = 5
"""Pictures of a close-up in which a whole face is looked for: what is no close-up gives lids of a cheek."""
REGION_SIDES = (0.9, 1.2, 1.5, 1.9, 2.4)
"""Sides of the regions tried in a close-up, as parts of the picture's height."""
REGION_SHIFTS = (-0.18, 0.0, 0.18)
JITTERS = ((0, 0, 0.9), (0, 0, 1.1), (0.05, 0, 1.0), (0, 0.05, 1.0))


class FaceMesh:
    """Both eyes of every face in a picture."""

    eyes = 2

    def __init__(self, client: MeshClient):
        self._client = client

    def detect(self, picture: Picture) -> list[Detection]:
        """Return the eyes of the faces whose eyes are 10 px wide or more, the largest face first."""
        eyes_of_faces = []
        for face in self._client.ask("faces", picture)["faces"]:
            eyes = [eye_points(np.array(upper), np.array(lower)) for upper, lower, _ in face["eyes"]]
            if min(eye_axis(eye)[2] for eye in eyes) >= LEAST_EYE_PX:
                iris = np.array([iris for _, _, iris in face["eyes"]])
                eyes_of_faces.append(Detection(np.concatenate(eyes), iris, np.array(face["box"])))
        return sorted(eyes_of_faces, key=lambda one: one.area_px2, reverse=True)


class CloseUp:
    """One eye that fills the picture, in a region found once by `look_for`."""

    eyes = 1

    def __init__(self, client: MeshClient):
        self._client = client
        self._region: tuple[float, float, float, bool] | None = None

    def look_for(self, pictures: Sequence[Picture]) -> None:
        """Choose the region whose contour moves least when the region is moved, and opens and closes most."""
        height, width = pictures[0].shape[:2]
        regions = [
            (width / 2 + dx * width, height / 2 + dy * height, side * height, flip)
            for side in REGION_SIDES
            for dx in REGION_SHIFTS
            for dy in REGION_SHIFTS
            for flip in (False, True)
        ]
        few = pictures[:: max(1, len(pictures) // 4)][:4]
        spread = np.mean([self._spread(picture, regions) for picture in few], axis=0)
        best = np.argsort(spread)[:6]
        heights = np.array([self._heights(p, [regions[k] for k in best]) for p in pictures])
        low, high = np.percentile(heights, [3, 90], axis=0)
        travel = (high - low) / np.maximum(high, 1e-6)
        self._region = regions[int(best[int(np.argmax(travel - 2 * spread[best]))])]

    def _spread(self, picture: Picture, regions: Sequence[Any]) -> Points:
        """How far the canthi move, as part of the eye's width, when each region is jittered."""
        moved = [
            (x + dx * side, y + dy * side, side * scale, flip)
            for x, y, side, flip in regions
            for dx, dy, scale in ((0, 0, 1.0), *JITTERS)
        ]
        answers = self._client.ask("eye", picture, regions=moved)["eyes"]
        canthi = np.array([(upper[0], upper[-1]) for upper, _, _ in answers])
        canthi = canthi.reshape(len(regions), len(JITTERS) + 1, 2, 2)
        width = np.hypot(*(canthi[:, 0, 1] - canthi[:, 0, 0]).T)
        away = np.sqrt(((canthi[:, 1:] - canthi[:, :1]) ** 2).sum(-1)).mean((1, 2))
        return np.asarray(away / np.maximum(width, 1e-6))

    def _heights(self, picture: Picture, regions: Sequence[Any]) -> list[float]:
        answers = self._client.ask("eye", picture, regions=list(regions))["eyes"]
        return [
            float(np.mean(np.array(lower)[3:6, 1]) - np.mean(np.array(upper)[3:6, 1]))
            for upper, lower, _ in answers
        ]

    def detect(self, picture: Picture) -> list[Detection]:
        """Return the eye in the region found before."""
        if self._region is None:
            return []
        ((upper, lower, iris),) = self._client.ask("eye", picture, regions=[self._region])["eyes"]
        up, low = np.array(upper), np.array(lower)
        # One-eye files begin at the image-left canthus, whichever that is.
        if up[0, 0] > up[-1, 0]:
            up, low = up[::-1], low[::-1]
        points = eye_points(up, low[::-1])
        box = np.concatenate([points.min(0), points.max(0)])
        return [Detection(points, np.array([iris]), box)]


@contextmanager
def open_detector(*, one_eye: bool, first: Sequence[Picture] = ()) -> Iterator[LidDetector]:
    """Start the detector; for a close-up of one eye `first` holds pictures (h, w, 3) to find the eye in.

    Raises
    ------
    InputError
        Most pictures meant as close-ups show a whole face.
    """
    with MeshClient(detector_environment()) as client:
        if not one_eye:
            yield FaceMesh(client)
            return
        _refuse_faces(FaceMesh(client), first)
        close_up = CloseUp(client)
        close_up.look_for(first)
        yield close_up


def _refuse_faces(mesh: FaceMesh, pictures: Sequence[Picture]) -> None:
    few = pictures[:: max(1, len(pictures) // FACES_ASKED)][:FACES_ASKED]
    faces = sum(bool(mesh.detect(picture)) for picture in few)
    if 2 * faces > len(few):
        raise InputError(
            f"a whole face is seen on {faces} of {len(few)} frames looked at, and --one-eye is for close-ups "
            "of one eye; leave it out"
        )
