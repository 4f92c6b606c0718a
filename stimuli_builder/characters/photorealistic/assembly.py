"""From rendered shots to the atlas: develop, lay over the still frame, write pictures and declaration."""

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stimuli_builder.characters.colour import linear_to_srgb, srgb_to_linear
from stimuli_builder.characters.declaration import Declaration, Level, LowerLid, LowerLidPose
from stimuli_builder.characters.photorealistic import anatomy, framing, plan
from stimuli_builder.characters.photorealistic.development import develop, to_8_bit
from stimuli_builder.characters.photorealistic.eyelid_skin import LidPose, build_skin
from stimuli_builder.characters.photorealistic.framing import Box, Frame, bounding_box
from stimuli_builder.characters.photorealistic.inbetween import Inbetweener, Rendered
from stimuli_builder.characters.photorealistic.parameters import Face
from stimuli_builder.characters.photorealistic.plan import Quality, closures_of
from stimuli_builder.characters.photorealistic.renderer import Shot
from stimuli_builder.characters.photorealistic.visibility import upper_lid_matte
from stimuli_builder.characters.writing import write_declaration, write_picture

Code = NDArray[np.float32]


class Assembly:
    """Pictures of one bake; `work` holds the shots."""

    def __init__(self, work: Path, face: Face, frame: Frame, quality: Quality) -> None:
        self.work, self.face, self.frame, self.quality = work, face, frame, quality
        still = develop(plan.base_shot(work, frame, quality).read()["frame"], face.exposure_ev)
        # The open level's own samples go into the still frame, so that nothing changes when a blink begins.
        self.still = self.lay(still, plan.level_shot(work, frame, quality, 0.0))

    @property
    def crop(self) -> Box:
        """Bounding box of what a blink may change."""
        return bounding_box(list(self.frame.eye_boxes().values()))

    @property
    def lower_lid_crop(self) -> Box:
        """Bounding box of what the lower lids may change."""
        return bounding_box(list(self.frame.lower_lid_boxes().values()))

    def level(self, closure: float) -> Code:
        """(h, w, 3) code values in 0-1 of the crop at a rendered closure."""
        if closure == 0.0:
            return _cut(self.still, self.crop)
        shot = plan.level_shot(self.work, self.frame, self.quality, closure)
        return _cut(self.lay(self.still, shot), self.crop)

    def rendered(self, levels: int) -> list[float]:
        """Those of an atlas's closures whose shots are there."""
        closures = closures_of(levels)
        shots = (plan.level_shot(self.work, self.frame, self.quality, closure) for closure in closures)
        return [closure for closure, shot in zip(closures, shots, strict=True) if shot.file.exists()]

    def levels(self, levels: int) -> Iterator[tuple[float, NDArray[np.uint8]]]:
        """Closures and 8-bit pictures of an atlas: rendered where there is a shot, else moved in between."""
        inbetweener = self._inbetweener(self.frame.eye_boxes(), self.crop)
        closures = self.rendered(levels)
        picture = to_8_bit(self.level(closures[0]))
        for low, high in pairwise(closures):
            yield low, picture
            upper = to_8_bit(self.level(high))
            ends = [Rendered(LidPose(w), srgb_to_linear(p)) for w, p in ((low, picture), (high, upper))]
            for closure in [w for w in closures_of(levels) if low < w < high]:
                share = (closure - low) / (high - low)
                yield closure, linear_to_srgb(inbetweener.mix(LidPose(closure), ends[0], ends[1], share))
            picture = upper
        yield closures[-1], picture

    def write(self, folder: Path, name: str, levels: int, provenance: dict[str, Any]) -> None:
        """Write a character of so many levels, with a lower lid if its poses are there; declaration last."""
        pictures = []
        for closure, picture in self.levels(levels):
            pictures.append(
                (closure, write_picture(folder, f"level_{round(closure * 256):03d}.webp", picture))
            )
        declaration = Declaration(
            name=name,
            label=f"Photorealistic: {self.face.label}",
            size_px=(self.frame.width_px, self.frame.height_px),
            px_per_mm=self.frame.px_per_mm,
            inter_ocular_mm=framing.INTER_OCULAR_MM,
            opening_mm=anatomy.OPENING_MM,
            crop=self.crop,
            base=write_picture(folder, "open.webp", to_8_bit(self.still)),
            levels=tuple(Level(closure=w, file=p.file, sha256=p.sha256) for w, p in pictures),
            lower_lid=self._write_lower_lid(folder) if self._has_lower_lid() else None,
            provenance=provenance,
        )
        write_declaration(folder, declaration)

    def _has_lower_lid(self) -> bool:
        shots = (plan.pose_shot(self.work, self.frame, self.quality, p) for p in plan.lower_lid_poses())
        return all(shot.file.exists() for shot in shots)

    def _write_lower_lid(self, folder: Path) -> LowerLid:
        """The grid of poses, and mattes."""
        crop, poses, mattes = self.lower_lid_crop, [], []
        for pose, image in self.lower_lid_poses():
            v, h = pose.vertical_mm, pose.horizontal_mm
            picture = write_picture(folder, f"lower_{round(v * 100):03d}_{round(h * 100):03d}.webp", image)
            poses.append(LowerLidPose(vertical_mm=v, horizontal_mm=h, **picture.model_dump()))
        for closure in plan.MATTE_CLOSURES:
            matte = np.zeros((self.frame.height_px, self.frame.width_px), np.float32)
            skin = build_skin(LidPose(closure))
            for side, box in zip((-1, 1), self.frame.lower_lid_boxes().values(), strict=True):
                x, y, width, height = box
                covered = upper_lid_matte(self.face, skin, self.frame, side, box)
                matte[y : y + height, x : x + width] = covered
            image = to_8_bit(_cut(matte, crop))
            picture = write_picture(folder, f"matte_{round(closure * 256):03d}.webp", image)
            mattes.append(Level(closure=closure, **picture.model_dump()))
        return LowerLid(crop=crop, poses=tuple(poses), mattes=tuple(mattes))

    def lower_lid_poses(self) -> Iterator[tuple[LidPose, NDArray[np.uint8]]]:
        """Poses of the open eye: the rendered ones, and one between every two neighbouring lifts."""
        inbetweener = self._inbetweener(self.frame.lower_lid_boxes(), self.lower_lid_crop)
        for h in plan.HORIZONTAL_MM:
            for low, high in pairwise(plan.VERTICAL_MM):
                poses = LidPose(0.0, low, h), LidPose(0.0, high, h)
                middle = LidPose(0.0, (low + high) / 2, h)
                yield poses[0], self._lower_lid(poses[0])
                ends = [Rendered(pose, srgb_to_linear(self._lower_lid(pose))) for pose in poses]
                yield middle, linear_to_srgb(inbetweener.mix(middle, ends[0], ends[1], 0.5))
            yield poses[1], self._lower_lid(poses[1])

    def _lower_lid(self, pose: LidPose) -> NDArray[np.uint8]:
        """8-bit picture of the lower lid's crop in a rendered pose."""
        if pose == LidPose(0.0):
            return to_8_bit(_cut(self.still, self.lower_lid_crop))
        shot = plan.pose_shot(self.work, self.frame, self.quality, pose)
        return to_8_bit(_cut(self.lay(self.still, shot), self.lower_lid_crop))

    def _inbetweener(self, boxes: dict[str, Box], crop: Box) -> Inbetweener:
        still = srgb_to_linear(to_8_bit(_cut(self.still, crop)))
        return Inbetweener(self.face, self.frame, boxes, crop, still)

    def lay(self, still: Code, shot: Shot) -> Code:
        """The still frame with a shot's boxes laid over it, feathered to the still frame on their rims."""
        laid = still.copy()
        for name, pixels in shot.read().items():
            x, y, width, height = box = shot.boxes[name]
            where = laid[y : y + height, x : x + width]
            where += self.frame.feather(box) * (develop(pixels, self.face.exposure_ev) - where)
        return laid


def _cut(image: Code, box: Box) -> Code:
    x, y, width, height = box
    return image[y : y + height, x : x + width]
