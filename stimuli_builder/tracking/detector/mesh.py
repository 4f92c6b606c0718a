"""The detector that ships: MediaPipe's face mesh with refined lids, or its iris network on a close-up."""

import json
import os
import shutil
import struct
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from experiments.errors import InputError
from stimuli_builder.tracking.detector.detection import (
    SIDE_OF_WIDTH,
    Detection,
    LidDetector,
    Region,
    contour_spread,
    contours_of,
    eye_points,
    overlap,
)
from stimuli_builder.tracking.shapes import Points, eye_axis, widths
from stimuli_builder.video import Picture

# Separate Python environments for libraries that conflict with ours, created at first use by uv.


def cache_folder() -> Path:
    """Folder for environments shared by all projects of a user (XDG_CACHE_HOME, else ~/.cache)."""
    # An empty variable counts as not set, as the XDG specification says.
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "palpebra"


def ensure_environment(folder: Path, python: str, requirements: Path, what: str, probe: str) -> Path:
    """Return the interpreter of an environment with the given packages, made where it lacks.

    Parameters
    ----------
    python : str
        Version, or path of an interpreter, that uv makes the environment with.
    requirements : Path
        File of pinned packages, hashes included; nothing else is installed.
    what : str
        What it is for, in words of the error.
    probe : str
        Statement that must run in it.

    Raises
    ------
    InputError
        The environment cannot be made, or the probe fails in it; an unfinished one is removed.
    """
    interpreter = folder / "bin" / "python"
    # Written last: a folder without it was left by an interrupted installation.
    ready = folder / "ready"
    if ready.exists():
        return interpreter
    shutil.rmtree(folder, ignore_errors=True)
    folder.parent.mkdir(parents=True, exist_ok=True)
    try:
        run_step([*uv(), "venv", "-q", str(folder), "--python", python], f"make the environment of {what}")
        # Without dependencies: MediaPipe names packages that its face mesh does not need.
        install = ["pip", "install", "-q", "--no-deps", "--require-hashes", "-r", str(requirements)]
        run_step([*uv(), *install, "--python", str(interpreter)], f"install {what}")
        run_step([str(interpreter), "-c", probe], f"start {what}")
    except InputError:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    ready.touch()
    return interpreter


def uv() -> list[str]:
    """The command uv, on the PATH or in the folder of the running Python."""
    beside = Path(sys.executable).with_name("uv")
    path = shutil.which("uv") or (str(beside) if beside.exists() else None)
    if path is None:
        raise InputError(
            "uv is not on the PATH: install it (pip install uv); it creates the required environment"
        )
    return [path]


def run_step(command: list[str], what: str) -> None:
    """Run one step of making an environment; its last line of complaint becomes the error."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - fixed program
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1].strip()
        raise InputError(f"cannot {what}: {last}")


# Talks to `mesh_worker.py`, which runs in a separate environment.

HERE = Path(__file__).parent
REQUIREMENTS = HERE / "requirements.txt"
NEWEST_PYTHON = (3, 12)
"""The newest Python that the detector's packages are built for."""


def detector_environment() -> Path:
    """Interpreter of the detector's environment, made at first use (270 MB on disk)."""
    # Our own Python saves a download where its version fits.
    own = sys.version_info[:2] <= NEWEST_PYTHON
    python = sys.executable if own else f"{NEWEST_PYTHON[0]}.{NEWEST_PYTHON[1]}"
    folder = cache_folder() / "face-mesh-0.10.21"
    probe = "import mediapipe; mediapipe.solutions.face_mesh"
    return ensure_environment(folder, python, REQUIREMENTS, "the face detector (MediaPipe)", probe)


# Decision 0370: The eye detector runs in its own environment.
class MeshClient:
    """The worker, started with the block and ended with it; one picture at a time."""

    def __init__(self, interpreter: Path):
        # -I: variables and packages of the user must not reach the worker.
        self._command = [str(interpreter), "-I", str(HERE / "mesh_worker.py")]

    def __enter__(self) -> Self:
        # MediaPipe writes warnings to stderr at every start.
        self._process = subprocess.Popen(  # noqa: S603 - fixed program
            self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # The end of its input is the sign for the worker to stop.
        if self._process.stdin:
            self._process.stdin.close()
        try:
            self._process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._process.stdout:
            self._process.stdout.close()

    def ask(self, operation: str, picture: Picture, **more: object) -> Any:
        """Send a picture, uint8 (h, w, 3), and return the answer.

        Raises
        ------
        ValueError
            The picture is of another kind, a gray one say.
        InputError
            The worker ended.
        """
        if picture.ndim != 3 or picture.shape[2] != 3 or picture.dtype != np.uint8:
            raise ValueError(f"expected an RGB picture, uint8 (h, w, 3), got {picture.dtype} {picture.shape}")
        head = json.dumps({"op": operation, "shape": list(picture.shape), **more}).encode()
        stdin, stdout = self._process.stdin, self._process.stdout
        try:
            if stdin is None or stdout is None:
                raise BrokenPipeError
            # Length of the head, the head, the pixels: the shape in the head gives their length.
            stdin.write(struct.pack("<q", len(head)) + head + picture.tobytes())
            stdin.flush()
            # A worker that ended gives fewer than 8 bytes, which is a struct.error.
            (length,) = struct.unpack("<q", stdout.read(8))
            return json.loads(stdout.read(length))
        except (BrokenPipeError, struct.error) as error:
            raise InputError(
                f"the face detector ended unexpectedly; remove its environment ({cache_folder()}) and run "
                "the command again to create a new one"
            ) from error


# MediaPipe's face mesh with refined lids: both eyes of every face in a picture.

LEAST_EYE_PX = 10
FACE_VIEWS = ((-0.2, 1.0), (0.2, 1.0), (0.0, 0.8), (0.0, 1.25))
"""A face's eye is also read in these, to check that it is there: shift along it in widths, and size. Those of
another size also detect an eye of which one half is covered."""
FILLING = 0.8
"""Part of the picture's shorter side from which on a face fills it, and is looked at with a margin."""
MARGIN = 0.25
"""Width of that margin, as part of the picture's longer side."""
MARGIN_GREY = 127
SAME_FACE = 0.2
"""Parts of an eye's width within which a face lies where its mirror image does: 0.06 or less in recordings
of faces, 0.23 or more where the mesh saw faces in a close-up."""
IRIS_MIRRORED = (0, 3, 2, 1, 4)
"""Center, right, upper, left and lower edge of an iris, as a mirror image has them."""


def views_of(eye: Points, *, flip: bool) -> list[Region]:
    """The regions in which a face's eye (9, 2) is read; the iris network knows one side's eyes."""
    along, _, width = eye_axis(eye)
    turn = float(np.degrees(np.arctan2(along[1], along[0])))
    # Points 0 and 5 are the canthi; lids are left out, as they move.
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


def unmirrored_face(face: Detection, width_px: int) -> Detection:
    """A face of a picture's mirror image, as the picture itself has it."""
    right = width_px - 1
    # A mirror image swaps the eyes as well.
    points = face.points.reshape(2, -1, 2)[::-1] * [-1, 1] + [right, 0]
    iris = face.iris[::-1, IRIS_MIRRORED] * [-1, 1] + [right, 0]
    left, top, end, low = face.box
    return Detection(points.reshape(-1, 2), iris, np.array([right - end, top, right - left, low]), ())


def face_distances(face: Detection, other: Detection) -> tuple[float, ...]:
    """Mean distance of each eye's points from those of another face, in widths of the first's eyes."""
    away = np.hypot(*(face.points - other.points).T).reshape(2, -1).mean(1)
    return tuple((away / widths(face.points)).tolist())


def in_both(face: Detection, others: Sequence[Detection]) -> Detection:
    """The mean of a face and of itself in the mirror image (`others`); the face where it is not there."""
    nearest = min(others, key=lambda other: max(face_distances(face, other)), default=None)
    shares = (np.inf, np.inf) if nearest is None else face_distances(face, nearest)
    # What lies farther off is another face, and the mirror image does not show this one.
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
        picture is looked at in a gray margin.
        """
        faces = self._read_twice(picture)
        if not faces or _fills(faces[0], picture):
            in_margin = self._faces_in_margin(picture)
            # Faces that both readings found are taken from the margin, where less is cut off.
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
            # The smaller eye decides: a face turned away has one that cannot be read.
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
        others = [unmirrored_face(face, picture.shape[1]) for face in turned]
        return [in_both(face, others) for face in faces]

    def _faces_in_margin(self, picture: Picture) -> list[Detection]:
        """The faces of a picture that has been given a margin, in the picture's own pixels.

        Those alone that the mirror image shows too: in the eye of a close-up the mesh sees one now and then.
        """
        # By the longer side, so that a face that fills a wide picture gets room above as well.
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
        # Infinite where the mirror image shows no such face, which says nothing of a cover.
        shares = np.nan_to_num(face.mirror_shares, posinf=0.0)
        # The mean of two readings is off by half their distance.
        return tuple(np.hypot(spreads, shares / 2).tolist())


# MediaPipe's iris network on a close-up: one eye, read in regions that are laid on it once.

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
            # Both sides: nobody says whether the close-up is of a left or a right eye.
            for side in REGION_SIDES
            for dx in REGION_SHIFTS
            for dy in REGION_SHIFTS
            for flip in (False, True)
        ]
        spread = np.mean([self._spread(p, regions) for p in spread_out(pictures, JITTERED)], axis=0)
        best = np.argsort(spread)[:6]
        heights = np.array([self._heights(p, [regions[k] for k in best]) for p in pictures])
        # Percentiles, since single readings may fail.
        low, high = np.percentile(heights, [3, 90], axis=0)
        # A contour on a brow or cheek does not move: only lids open and close.
        travel = (high - low) / np.maximum(high, 1e-6)
        region = regions[int(best[int(np.argmax(travel - 2 * spread[best]))])]
        self._views = region.views(region.side / SIDE_OF_WIDTH)
        # The first round reads in a rough region; the second in one laid by that reading.
        for _ in range(2):
            self._lay(spread_out(pictures, LAID_ON), region.flip)

    def _lay(self, pictures: Sequence[Picture], flip: bool) -> None:
        """Lay the views on the eye's middle, in the median of pictures, with sides by its width."""
        canthi = np.array([self._points(picture)[0][[0, 5]] for picture in pictures])
        width = float(np.median(np.hypot(*(canthi[:, 1] - canthi[:, 0]).T)))
        if width < LEAST_EYE_PX:
            raise InputError(
                f"the eye in this close-up is {width:.0f} px wide, but at least {LEAST_EYE_PX} px are "
                "needed; remove --one-eye if the video shows a face"
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
        # Canthi only: they stay where they are while the eye blinks.
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


FACES_ASKED = 5
"""Pictures of a close-up in which a whole face is looked for: otherwise a picture that is not a close-up
gives lids on a cheek."""


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
    # More than half, since in single close-ups the mesh sees faces that are not there.
    if 2 * faces > len(few):
        raise InputError(
            f"a whole face was detected in {faces} of {len(few)} frames, but --one-eye is for close-ups of "
            "one eye; remove --one-eye"
        )


def _shows_a_face(mesh: FaceMesh, picture: Picture) -> bool:
    """Whether a face is seen in a picture and, at the same place, in its mirror image.

    In the iris and lashes of a close-up the mesh sees small faces, somewhere else in the mirror image.
    """
    seen, turned = mesh.faces(picture), mesh.faces(np.ascontiguousarray(picture[:, ::-1]))
    if not seen or not turned:
        return False
    return bool(np.mean(face_distances(seen[0], unmirrored_face(turned[0], picture.shape[1]))) < SAME_FACE)
