"""Labels proposed by a landmark detector: an optional extra, with weights that the user brings."""

from importlib import import_module
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.tracking.labels import Labels, save_labels
from stimuli_builder.tracking.shapes import Points, default_markers, moved, similarity_between
from stimuli_builder.video import Picture, VideoInfo, frames, rgb

# Numbers of the face mesh's 468 points: outer canthus, upper lid, inner canthus, lower lid, of both eyes.
LEFT = (33, 161, 159, 158, 173, 133, 154, 145, 163)
RIGHT = (263, 388, 386, 385, 398, 362, 381, 374, 390)
LOOKED_AT = 400
FARTHEST_LABEL = 5000


def propose_labels(info: VideoInfo, out: Path, weights: Path | None, count: int) -> Labels:
    """Detect landmarks on frames across the video and save those most unlike one another as labels.

    Raises
    ------
    InputError
        MediaPipe is not installed, no weights are given, or too few frames show a face.
    """
    detect = _detector(weights)
    last = min(info.frame_count, FARTHEST_LABEL)
    step = max(1, last // LOOKED_AT)
    found: dict[int, Points] = {}
    for number, picture in enumerate(islice(frames(info.path, read=rgb), last)):
        points = detect(picture) if number % step == 0 else None
        if points is not None and _inside(points, info.size_px):
            found[number] = points
    if len(found) < count:
        raise InputError(
            f"{info.path}: a face was found on {len(found)} frames, {count} are needed; label by hand"
        )
    chosen = most_varied(found, count)
    labels = Labels(out, info.size_px, default_markers(2), {number: found[number] for number in chosen})
    save_labels(
        labels, info.path.name, "landmark detector on single frames, not reviewed; half-closed lids sit low"
    )
    return labels


def _inside(points: Points, size_px: tuple[int, int]) -> bool:
    return bool((points >= 0).all() and (points <= np.array(size_px) - 1).all())


def most_varied(shapes: dict[int, Points], count: int) -> list[int]:
    """Frames whose shapes, freed of position, size and turn, lie farthest from one another; ascending."""
    numbers = sorted(shapes)
    first = shapes[numbers[0]]
    rows = np.array([moved(shapes[n], similarity_between(shapes[n], first)).ravel() for n in numbers])
    chosen = [int(((rows - np.median(rows, axis=0)) ** 2).sum(1).argmin())]
    distance: NDArray[np.float64] = np.full(len(numbers), np.inf)
    while len(chosen) < min(count, len(numbers)):
        distance = np.minimum(distance, ((rows - rows[chosen[-1]]) ** 2).sum(1))
        chosen.append(int(distance.argmax()))
    return sorted(numbers[place] for place in chosen)


def _detector(weights: Path | None) -> Any:
    """A function from an RGB picture to 18 points, or None where it sees no face."""
    if find_spec("mediapipe") is None:
        raise InputError(
            "label --bootstrap needs the optional package MediaPipe: pip install 'mediapipe>=1.2'"
        )
    if weights is None or not weights.is_file():
        raise InputError(
            f"expected --weights with a face_landmarker.task file, found {weights or 'none'}; "
            "no weights are shipped"
        )
    mediapipe = import_module("mediapipe")
    tasks = import_module("mediapipe.tasks.python")
    vision = import_module("mediapipe.tasks.python.vision")
    options = vision.FaceLandmarkerOptions(base_options=tasks.BaseOptions(model_asset_path=str(weights)))
    try:
        landmarker = vision.FaceLandmarker.create_from_options(options)
    except (RuntimeError, ValueError) as error:
        raise InputError(
            f"{weights}: not a face_landmarker.task that MediaPipe takes ({str(error).splitlines()[0]})"
        ) from error

    def detect(picture: Picture) -> Points | None:
        image = mediapipe.Image(image_format=mediapipe.ImageFormat.SRGB, data=picture)
        faces = landmarker.detect(image).face_landmarks
        return _points(faces[0], picture.shape) if faces else None

    return detect


def _points(face: Any, shape: tuple[int, ...]) -> Points:
    height, width = shape[:2]
    return np.array([(face[p].x * width - 0.5, face[p].y * height - 0.5) for p in (*LEFT, *RIGHT)])
