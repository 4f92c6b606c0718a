"""The detector that ships: MediaPipe's face mesh with refined lids, or its iris network on a close-up."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from experiments.errors import InputError
from stimuli_builder.tracking.detector.close_up import CloseUp, spread_out
from stimuli_builder.tracking.detector.detection import LidDetector
from stimuli_builder.tracking.detector.face_mesh import SAME_FACE, FaceMesh, apart, mirrored
from stimuli_builder.tracking.detector.mesh_client import MeshClient, detector_environment
from stimuli_builder.video import Picture

FACES_ASKED = 5
"""Pictures of a close-up in which a whole face is looked for: what is no close-up gives lids of a cheek."""


@contextmanager
def open_detector(*, one_eye: bool, first: Sequence[Picture] = ()) -> Iterator[LidDetector]:
    """Start the detector; for a close-up of one eye `first` holds pictures (h, w, 3) to find the eye in.

    Raises
    ------
    InputError
        Most pictures meant as close-ups show a whole face, or an eye less than 10 px wide.
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
    few = spread_out(pictures, FACES_ASKED)
    faces = sum(_shows_a_face(mesh, picture) for picture in few)
    if 2 * faces > len(few):
        raise InputError(
            f"a whole face is seen on {faces} of {len(few)} frames looked at, and --one-eye is for close-ups "
            "of one eye; leave it out"
        )


def _shows_a_face(mesh: FaceMesh, picture: Picture) -> bool:
    """Whether a face is seen in a picture and, at the same place, in its mirror image.

    In the iris and lashes of a close-up the mesh sees small faces, somewhere else in the mirror image.
    """
    seen, turned = mesh.faces(picture), mesh.faces(np.ascontiguousarray(picture[:, ::-1]))
    if not seen or not turned:
        return False
    return bool(np.mean(apart(seen[0], mirrored(turned[0], picture.shape[1]))) < SAME_FACE)
