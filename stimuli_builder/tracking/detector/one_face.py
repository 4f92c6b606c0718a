"""One face through a recording that shows several: which is larger may change, whose track it is may not."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from stimuli_builder.tracking.detector.detection import Detection

NEAR = 0.5
"""A face is the one before if its middle has moved by less than this part of the wider one's width."""
Values = NDArray[np.float64]


def one_face(seen: Mapping[int, Sequence[Detection]]) -> dict[int, Detection]:
    """Frame -> the face to be tracked: the one that is larger over the whole recording.

    Faces are followed from frame to frame by their place. The face with the largest summed area is taken, and
    then every other that is in no frame beside one taken already: the same person after a gap or a cut.

    Parameters
    ----------
    seen : mapping of int to sequence of Detection
        Frame -> all faces seen in it.
    """
    taken: dict[int, Detection] = {}
    for face in sorted(_followed(seen), key=_summed_area, reverse=True):
        if not taken.keys() & face.keys():
            taken |= face
    return dict(sorted(taken.items()))


def _followed(seen: Mapping[int, Sequence[Detection]]) -> list[dict[int, Detection]]:
    """Every face as its frames, linked to the nearest one of the frames before."""
    faces: list[dict[int, Detection]] = []
    for number in sorted(seen):
        for detection in sorted(seen[number], key=_area, reverse=True):
            open_faces = [face for face in faces if number not in face]
            away = [_away(face[max(face)], detection) for face in open_faces]
            if away and min(away) < NEAR:
                open_faces[int(np.argmin(away))][number] = detection
            else:
                faces.append({number: detection})
    return faces


def _away(before: Detection, now: Detection) -> float:
    """Distance of the middles of two faces, as part of the wider one's width."""
    one, other = _sides(before), _sides(now)
    between = (now.box[:2] + now.box[2:] - before.box[:2] - before.box[2:]) / 2
    return float(np.hypot(*between) / max(one[0], other[0], 1e-6))


def _sides(detection: Detection) -> Values:
    return np.asarray(detection.box[2:] - detection.box[:2])


def _area(detection: Detection) -> float:
    return float(np.prod(_sides(detection)))


def _summed_area(face: Mapping[int, Detection]) -> float:
    return sum(_area(detection) for detection in face.values())
