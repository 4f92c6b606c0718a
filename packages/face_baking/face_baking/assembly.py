"""From rendered shots to the atlas: develop, lay over the still frame, move levels in between, write."""

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from face_baking.development import photographed, to_8_bit
from face_baking.framing import INTER_OCULAR_MM, Box, bounding_box
from face_baking.inbetween import flow_mix
from face_baking.lid_pose import (
    HORIZONTAL_MM,
    OPEN,
    RENDERED_HORIZONTAL_MM,
    VERTICAL_MM,
    LidPose,
)
from face_baking.matte import MATTE_CLOSURES, upper_lid_matte
from face_baking.plan import closures_of
from face_baking.pose_motion import pose_between
from face_baking.renderer import Shot
from face_baking.scene import FaceScene
from stimuli_builder.characters.atlas import write_level_video
from stimuli_builder.characters.colour import linear_to_srgb, srgb_to_linear
from stimuli_builder.characters.declaration import (
    Declaration,
    Level,
    LowerLid,
    LowerLidPose,
    PictureOrFrame,
    write_bytes,
    write_declaration,
    write_picture,
)

STUDIO_EV = 0.15
STEADY_CODE = 0.03
"""A change of this share of white is movement; one far below it is a change of light on still skin."""
STEADY_PX = 1.5
LEVELS_FILE, POSES_FILE, STILL_FILE = "levels.mkv", "lower_lid.mkv", "open.mkv"
NOTICE_FILE = Path(__file__).with_name("ICT-FaceKit-LICENSE.txt")
"""Is put into the folder of every character rendered from the kit's geometry, as its license requires."""
Picture = NDArray[np.uint8]


class Assembly:
    """Pictures of one bake: its levels at the closures `rendered`, ascending; `lower` are poses."""

    def __init__(
        self, scene: FaceScene, frame: Shot, levels: list[Shot], lower: list[Shot], rendered: list[float]
    ) -> None:
        self._scene, self._rendered = scene, rendered
        self._levels = {shot.pose.closure: shot for shot in levels}
        self._lower = {shot.pose: shot for shot in lower}
        self.crop = bounding_box(list(scene.boxes.values()))
        self.lower_lid_crop = bounding_box(list(scene.lower_lid_boxes.values()))
        opened = self._levels[0.0]
        self._steady = {
            name: (opened.boxes[name], self._developed(light))
            for name, light in opened.read().items()
            if opened.finer and name not in opened.finer
        }
        still = self._developed(frame.read()["frame"])
        # The open level's own samples go into the still frame, so that nothing changes when a blink begins.
        self._still = self._laid(still, opened)

    def level(self, closure: float) -> Picture:
        """(h, w, 3) sRGB code values of the crop at a rendered closure."""
        frame = self._still if closure == 0.0 else self._laid(self._still, self._levels[closure])
        return to_8_bit(_cut(frame, self.crop))

    def levels(self, count: int) -> Iterator[tuple[float, Picture]]:
        """Closures and pictures of an atlas: rendered where there is a shot, else moved in between."""
        low_picture = self.level(self._rendered[0])
        for low, high in pairwise(self._rendered):
            yield low, low_picture
            high_picture = self.level(high)
            ends = srgb_to_linear(low_picture), srgb_to_linear(high_picture)
            for closure in closures_of(count):
                if low < closure < high:
                    share = (closure - low) / (high - low)
                    yield closure, _encoded(flow_mix(*ends, share))
            low_picture = high_picture
        yield self._rendered[-1], low_picture

    def write(
        self, folder: Path, name: str, count: int, provenance: dict[str, Any], version: int = 1
    ) -> None:
        """Write the character, its declaration last."""
        closures, pictures = zip(*self.levels(count), strict=True)
        video = write_level_video(folder, LEVELS_FILE, pictures)
        still = write_level_video(folder, STILL_FILE, [to_8_bit(self._still)])
        view = self._scene.view
        declaration = Declaration(
            name=name,
            version=version,
            label=", ".join(filter(None, (self._scene.identity.label, self._scene.framing.shows))),
            size_px=view.size_px,
            px_per_mm=view.px_per_mm,
            inter_ocular_mm=INTER_OCULAR_MM,
            opening_mm=round(self._scene.opening_mm, 2),
            crop=self.crop,
            base=PictureOrFrame(frame=0, **still.model_dump()),
            levels=tuple(
                Level(closure=closure, file=video.file, sha256=video.sha256, frame=number)
                for number, closure in enumerate(closures)
            ),
            lower_lid=self._write_lower_lid(folder),
            provenance=provenance,
        )
        write_bytes(folder / NOTICE_FILE.name, NOTICE_FILE.read_bytes())
        write_declaration(folder, declaration)

    def _developed(self, light: NDArray[np.float16]) -> NDArray[np.float32]:
        return photographed(light, self._scene.identity.exposure_ev + STUDIO_EV)

    def _laid(self, still: NDArray[np.float32], shot: Shot) -> NDArray[np.float32]:
        """The still frame with a shot's boxes laid over it, feathered to the still frame on their rims.

        Where lids have boxes with separate samples, of the others only the change since the open eye
        counts: one seed gives both the same noise, so that still skin keeps the still frame's many samples.
        """
        laid = still.copy()
        for name, light in shot.read().items():
            x, y, width, height = box = shot.boxes[name]
            where, picture = laid[y : y + height, x : x + width], self._developed(light)
            if name in self._steady:
                (left, top, _, _), opened = self._steady[name]
                picture = steadied(picture, _cut(opened, (x - left, y - top, width, height)), where)
            where += self._scene.view.feather(box) * (picture - where)
        return laid

    def _write_lower_lid(self, folder: Path) -> LowerLid | None:
        """The grid of poses and the mattes, once every pose is rendered."""
        if not self._lower or not all(shot.file.exists() for shot in self._lower.values()):
            return None
        posed, pictures = zip(*self.lower_lid_poses(), strict=True)
        video = write_level_video(folder, POSES_FILE, pictures)
        poses = [
            LowerLidPose(
                vertical_mm=pose.vertical_mm, horizontal_mm=pose.horizontal_mm, frame=k, **video.model_dump()
            )
            for k, pose in enumerate(posed)
        ]
        mattes = []
        for closure in MATTE_CLOSURES:
            matte = upper_lid_matte(self._scene, LidPose(closure), self.lower_lid_crop)
            picture = write_picture(folder, f"matte_{round(closure * 256):03d}.webp", _grey(matte))
            mattes.append(Level(closure=closure, **picture.model_dump()))
        return LowerLid(crop=self.lower_lid_crop, poses=tuple(poses), mattes=tuple(mattes))

    def lower_lid_poses(self) -> Iterator[tuple[LidPose, Picture]]:
        """Poses of the open eyes: the rendered ones, slides between them, and lifts between those."""
        for h in HORIZONTAL_MM:
            lifts = [(v, self._lower_lid(LidPose(0.0, v, h))) for v in VERTICAL_MM]
            for (low, first), (high, second) in pairwise(lifts):
                yield LidPose(0.0, low, h), first
                middle = flow_mix(srgb_to_linear(first), srgb_to_linear(second), 0.5)
                yield LidPose(0.0, (low + high) / 2, h), _encoded(middle)
            yield LidPose(0.0, lifts[-1][0], h), lifts[-1][1]

    def _lower_lid(self, pose: LidPose) -> Picture:
        """The lower lids' crop in a pose: as rendered, or moved from the rendered slides on both sides."""
        if pose != OPEN and pose not in self._lower:
            slides = RENDERED_HORIZONTAL_MM
            before = max(h for h in slides if h < pose.horizontal_mm)
            after = min(h for h in slides if h > pose.horizontal_mm)
            ends = [LidPose(pose.closure, pose.vertical_mm, h) for h in (before, after)]
            around = {end: srgb_to_linear(self._lower_lid(end)) for end in ends}
            return _encoded(pose_between(self._scene, pose, around, self.lower_lid_crop))
        frame = self._still if pose == OPEN else self._laid(self._still, self._lower[pose])
        return to_8_bit(_cut(frame, self.lower_lid_crop))


def steadied(
    picture: NDArray[np.float32], opened: NDArray[np.float32], still: NDArray[np.float32]
) -> NDArray[np.float32]:
    """(h, w, 3) code of a picture: the still one plus its change from `opened`, itself where it moves.

    Parameters
    ----------
    picture, opened : float32 array (h, w, 3)
        A pose and the open eye, rendered with the same few samples and seed.
    still : float32 array (h, w, 3)
        The open eye of many samples.
    """
    change = picture - opened
    size = cv2.GaussianBlur(np.abs(change).max(axis=-1), (0, 0), STEADY_PX)
    share = np.exp(-((size / STEADY_CODE) ** 2))[..., None]
    return np.asarray(picture + share * (still - opened), np.float32)


def _encoded(light: NDArray[np.float32]) -> Picture:
    """SRGB code values of light that interpolation may have taken below 0."""
    return linear_to_srgb(np.maximum(light, 0))


def _cut(image: NDArray[np.float32], box: Box) -> NDArray[np.float32]:
    x, y, width, height = box
    return image[y : y + height, x : x + width]


def _grey(matte: Picture) -> Picture:
    return np.repeat(matte[..., None], 3, axis=2)
