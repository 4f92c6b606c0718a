"""MediaPipe's face mesh with refined lids: both eyes of every face in a picture."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stimuli_builder.tracking.detector.detection import Detection, contour_spread, eye_points
from stimuli_builder.tracking.detector.eye_regions import SIDE_OF_WIDTH, Region, contours_of
from stimuli_builder.tracking.detector.mesh_client import MeshClient
from stimuli_builder.tracking.detector.one_face import overlap
from stimuli_builder.tracking.shapes import Points, eye_axis, widths
from stimuli_builder.video import Picture

LEAST_EYE_PX = 10
FACE_VIEWS = ((-0.2, 1.0), (0.2, 1.0), (0.0, 0.8), (0.0, 1.25))
"""A face's eye is read in these besides, to tell whether one is there: shift along it in widths, and size.
Those of another size tell an eye of which a half is covered too."""
FILLING = 0.8
"""Part of the picture's shorter side from which on a face fills it, and is looked at with a margin."""
MARGIN = 0.25
"""Width of that margin, as part of the picture's longer side."""
MARGIN_GREY = 127
SAME_FACE = 0.2
"""Parts of an eye's width within which a face lies where its mirror image does: 0.06 or less in recordings
of faces, 0.23 or more where the mesh saw faces in a close-up."""
IRIS_MIRRORED = (0, 3, 2, 1, 4)
"""Centre, right, upper, left and lower edge of an iris, as a mirror image has them."""


def views_of(eye: Points, *, flip: bool) -> list[Region]:
    """The regions in which a face's eye (9, 2) is read; the iris network knows one side's eyes."""
    along, _, width = eye_axis(eye)
    turn = float(np.degrees(np.arctan2(along[1], along[0])))
    middles = [(eye[0] + eye[5]) / 2 + shift * width * along for shift, _ in FACE_VIEWS]
    sides = [SIDE_OF_WIDTH * width * size for _, size in FACE_VIEWS]
    return [Region(float(x), float(y), side, flip, turn) for (x, y), side in zip(middles, sides, strict=True)]


def _about(picture: Picture, views: Sequence[Region]) -> tuple[Picture, list[Region]]:
    """The part of a picture that views see, a side wide about each, and the views in it."""
    at, side = np.array([[view.y, view.x] for view in views]), max(view.side for view in views)
    last = np.array(picture.shape[:2]) - 1
    # At least a pixel, where a face's eyes are thought beyond the picture.
    top, left = np.clip((at.min(0) - side).astype(np.int64), 0, last).tolist()
    bottom, right = np.clip((at.max(0) + side).astype(np.int64), 0, last).tolist()
    part = np.ascontiguousarray(picture[top : bottom + 1, left : right + 1])
    return part, [view._replace(x=view.x - left, y=view.y - top) for view in views]


def mirrored(face: Detection, width_px: int) -> Detection:
    """A face of a picture's mirror image, as the picture itself has it."""
    right = width_px - 1
    points = face.points.reshape(2, -1, 2)[::-1] * [-1, 1] + [right, 0]
    iris = face.iris[::-1, IRIS_MIRRORED] * [-1, 1] + [right, 0]
    left, top, end, low = face.box
    return Detection(points.reshape(-1, 2), iris, np.array([right - end, top, right - left, low]), ())


def apart(face: Detection, other: Detection) -> tuple[float, ...]:
    """Mean distance of each eye's points from those of another face, in widths of the first's eyes."""
    away = np.hypot(*(face.points - other.points).T).reshape(2, -1).mean(1)
    return tuple((away / widths(face.points)).tolist())


def in_both(face: Detection, others: Sequence[Detection]) -> Detection:
    """The mean of a face and of itself in the mirror image (`others`); the face where it is not there."""
    nearest = min(others, key=lambda other: max(apart(face, other)), default=None)
    shares = (np.inf, np.inf) if nearest is None else apart(face, nearest)
    if nearest is None or np.mean(shares) > SAME_FACE:
        return replace(face, mirror_shares=(np.inf, np.inf))
    points, iris = (face.points + nearest.points) / 2, (face.iris + nearest.iris) / 2
    return replace(face, points=points, iris=iris, mirror_shares=shares)


def _fills(face: Detection, picture: Picture) -> bool:
    """Whether a face is nearly as large as its picture."""
    return bool(np.sqrt(face.area_px2) > FILLING * min(picture.shape[:2]))


class FaceMesh:
    """Both eyes of every face in a picture."""

    eyes = 2

    def __init__(self, client: MeshClient):
        self._client = client

    def detect(self, picture: Picture) -> list[Detection]:
        """Return the eyes of the faces whose eyes are 10 px wide or more, the largest face first.

        Each face is read in the picture and in its mirror image, and the mean is taken. One that fills the
        picture may not be seen: the mesh expects something around it. Where none is seen or one fills it, the
        picture is looked at in a grey margin (docs/decisions/0971).
        """
        faces = self._read_twice(picture)
        if not faces or _fills(faces[0], picture):
            in_margin = self._faces_in_margin(picture)
            beside = [face for face in faces if all(overlap(face, one) == 0 for one in in_margin)]
            faces = sorted(in_margin + beside, key=lambda one: one.area_px2, reverse=True)
        return [replace(one, spreads=self._spreads(picture, one)) for one in faces]

    def faces(self, picture: Picture) -> list[Detection]:
        """The same by one reading, without the eyes' `spreads`, which take longest."""
        return self._of_size(picture, LEAST_EYE_PX)

    def _of_size(self, picture: Picture, least_eye_px: float) -> list[Detection]:
        eyes_of_faces = []
        for face in self._client.ask("faces", picture)["faces"]:
            eyes = [eye_points(np.array(upper), np.array(lower)) for upper, lower, _ in face["eyes"]]
            if min(eye_axis(eye)[2] for eye in eyes) >= least_eye_px:
                iris = np.array([iris for _, _, iris in face["eyes"]])
                eyes_of_faces.append(Detection(np.concatenate(eyes), iris, np.array(face["box"]), ()))
        return sorted(eyes_of_faces, key=lambda one: one.area_px2, reverse=True)

    def _read_twice(self, picture: Picture) -> list[Detection]:
        """The faces of a picture; those that its mirror image shows too are the mean of both."""
        faces = self.faces(picture)
        if not faces:
            return []
        # Eyes of 10 px in the picture may be read a little smaller here.
        turned = self._of_size(np.ascontiguousarray(picture[:, ::-1]), LEAST_EYE_PX / 2)
        others = [mirrored(face, picture.shape[1]) for face in turned]
        return [in_both(face, others) for face in faces]

    def _faces_in_margin(self, picture: Picture) -> list[Detection]:
        """The faces of a picture that has been given a margin, in the picture's own pixels.

        Those alone that the mirror image shows too: in the eye of a close-up the mesh sees one now and then.
        """
        margin = round(MARGIN * max(picture.shape[:2]))
        sides = ((margin, margin), (margin, margin), (0, 0))
        wider = np.pad(picture, sides, constant_values=MARGIN_GREY)
        faces = self._read_twice(wider)
        return [face.moved(-margin, -margin) for face in faces if np.isfinite(face.mirror_shares).all()]

    def _spreads(self, picture: Picture, face: Detection) -> tuple[float, ...]:
        """How steadily each eye of a face is read, see `Detection.spreads`.

        A face that the mirror image does not show is judged by its contours alone: that it is not seen there
        says nothing of a cover.
        """
        eyes = face.points.reshape(2, -1, 2)
        views = [view for number, eye in enumerate(eyes) for view in views_of(eye, flip=number == 1)]
        part, within = _about(picture, views)
        seen = self._client.ask("eye", part, regions=within)["eyes"]
        contours = contours_of(seen).reshape(len(eyes), len(FACE_VIEWS), -1, 2)
        spreads = [contour_spread(one, eye_axis(eye)[2]) for one, eye in zip(contours, eyes, strict=True)]
        shares = np.nan_to_num(face.mirror_shares, posinf=0.0)
        return tuple(np.hypot(spreads, shares / 2).tolist())
