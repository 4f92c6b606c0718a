"""Which pictures a bake needs, coarse before fine, so that every finished generation is an atlas."""

from dataclasses import dataclass
from pathlib import Path

from experiments.errors import InputError
from stimuli_builder.characters.photorealistic.eyelid_skin import LidPose
from stimuli_builder.characters.photorealistic.framing import Frame
from stimuli_builder.characters.photorealistic.renderer import Shot

LEVEL_COUNTS = (2, 3, 5, 9, 17, 33, 65, 129, 257)
MATTE_CLOSURES = tuple(k / 32 for k in range(33))
# What a blink does to the lower lid reaches 1 mm upwards and 5 mm towards the nose (blinks/lower_lid.py).
# A slide of more than a lash's spacing cannot be followed by optical flow, so every position is rendered.
VERTICAL_MM = (0.0, 0.5, 1.0)
HORIZONTAL_MM = tuple(k / 2 for k in range(11))
LOWER_LID_AFTER_LEVELS = 9


@dataclass(frozen=True)
class Quality:
    """Cycles samples per pixel of the moving crop and of the still frame."""

    crop_samples: int
    frame_samples: int


def closures_of(levels: int) -> list[float]:
    """The evenly spaced closures of an atlas; InputError unless levels is 2^k + 1."""
    if levels not in LEVEL_COUNTS:
        raise InputError(f"levels must be one of {', '.join(map(str, LEVEL_COUNTS))}; it is {levels}")
    return [k / (levels - 1) for k in range(levels)]


def base_shot(work: Path, frame: Frame, quality: Quality) -> Shot:
    """The whole open-eye frame."""
    boxes = {"frame": (0, 0, frame.width_px, frame.height_px)}
    return Shot(work / "frame.npz", LidPose(0.0), boxes, quality.frame_samples)


def level_shot(work: Path, frame: Frame, quality: Quality, closure: float) -> Shot:
    """Both eyes at one closure."""
    return Shot(work / f"level_{closure:.6f}.npz", LidPose(closure), frame.eye_boxes(), quality.crop_samples)


def pose_shot(work: Path, frame: Frame, quality: Quality, pose: LidPose) -> Shot:
    """Both lower lids of the open eye, displaced."""
    name = f"pose_{pose.vertical_mm:.2f}_{pose.horizontal_mm:.2f}.npz"
    return Shot(work / name, pose, frame.lower_lid_boxes(), quality.crop_samples)


def lower_lid_poses() -> list[LidPose]:
    """The rendered positions of the lower lid; the resting one is the open level itself."""
    grid = [LidPose(0.0, v, h) for h in HORIZONTAL_MM for v in VERTICAL_MM]
    return [pose for pose in grid if pose != LidPose(0.0)]


@dataclass(frozen=True)
class Stage:
    """Shots after which an atlas of `levels` levels can be written."""

    levels: int
    lower_lid: bool
    shots: tuple[Shot, ...]


def stages(work: Path, frame: Frame, quality: Quality, levels: int) -> list[Stage]:
    """Bisecting generations; the lower lid follows the ninth level (or the last, if there are fewer)."""
    closures_of(levels)
    counts = [count for count in LEVEL_COUNTS if count <= levels]
    plan, done = [], {None}
    for count in counts:
        fresh = [w for w in closures_of(count) if w not in done]
        done |= set(fresh)  # type: ignore[arg-type]
        shots = [level_shot(work, frame, quality, closure) for closure in fresh]
        if count == counts[0]:
            shots.insert(0, base_shot(work, frame, quality))
        plan.append(Stage(count, count > LOWER_LID_AFTER_LEVELS, tuple(shots)))
        if count == min(LOWER_LID_AFTER_LEVELS, levels):
            lower = [pose_shot(work, frame, quality, pose) for pose in lower_lid_poses()]
            plan.append(Stage(count, True, tuple(lower)))
    return plan
