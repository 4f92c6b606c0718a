"""Which pictures a bake needs, coarse before fine, so that every finished generation is an atlas."""

from dataclasses import dataclass
from pathlib import Path

from experiments.errors import InputError
from face_baking.framing import Box
from face_baking.lid_pose import OPEN, RENDERED_HORIZONTAL_MM, VERTICAL_MM, LidPose
from face_baking.renderer import Shot

LEVEL_COUNTS = (2, 3, 5, 9, 17, 33, 65, 129)
END_SHARE = 1 / 8
LOWER_LID_AFTER = 10
"""Shots before the lower lid's: the still frame and nine levels."""


LASHES_HANG = 0.5
"""From here on lashes lie before the lid, where few samples break them into dots: it gets twice as many."""


@dataclass(frozen=True)
class Samples:
    """Cycles samples per pixel of the moving boxes, of the still frame, and of where lids and lashes pass.

    `lids` 0 renders the boxes alone, as before there were lids' boxes in them.
    """

    boxes: int
    frame: int
    lids: int = 0


def closures_of(levels: int) -> list[float]:
    """The evenly spaced closures of an atlas; InputError unless levels is 2^k + 1."""
    if levels not in LEVEL_COUNTS:
        raise InputError(f"levels must be one of {', '.join(map(str, LEVEL_COUNTS))}; it is {levels}")
    return [k / (levels - 1) for k in range(levels)]


def frame_shot(work: Path, size_px: tuple[int, int], samples: Samples) -> Shot:
    """The whole frame with open eyes."""
    return Shot(work / "frame.npz", OPEN, {"frame": (0, 0, *size_px)}, samples.frame)


def denser_ends(levels: int) -> list[float]:
    """The closures halfway between those of the first and of the last eighth of an even grid.

    There a picture moved in between errs most: the lid begins to move, and the lids' lashes meet.
    """
    halfway = [(k + 0.5) / (levels - 1) for k in range(levels - 1)]
    return [closure for closure in halfway if closure < END_SHARE or closure > 1 - END_SHARE]


def level_shots(
    work: Path,
    boxes: dict[str, Box],
    samples: Samples,
    levels: int,
    ends: bool = False,
    lid_boxes: dict[str, Box] | None = None,
) -> list[Shot]:
    """Both eyes at each closure: both ends, then closures halfway between those before; last, denser ends."""
    lids = {f"{name}_lids": box for name, box in (lid_boxes or {}).items() if samples.lids}
    plan: list[Shot] = []
    planned: set[float] = set()
    for count in LEVEL_COUNTS[: LEVEL_COUNTS.index(levels) + 1]:
        fresh = [closure for closure in closures_of(count) if closure not in planned]
        planned |= set(fresh)
        plan += [_level_shot(work, closure, boxes, lids, samples) for closure in fresh]
    further = [closure for closure in denser_ends(levels) if ends]
    return plan + [_level_shot(work, closure, boxes, lids, samples) for closure in further]


def _level_shot(
    work: Path, closure: float, boxes: dict[str, Box], lids: dict[str, Box], samples: Samples
) -> Shot:
    finer = dict.fromkeys(lids, samples.lids * (2 if closure > LASHES_HANG else 1))
    return Shot(work / f"level_{closure:.6f}.npz", LidPose(closure), boxes | lids, samples.boxes, finer)


def lower_lid_shots(work: Path, boxes: dict[str, Box], samples: Samples) -> list[Shot]:
    """Both lower lids of the open eyes in each rendered position but the resting one."""
    poses = [LidPose(0.0, v, h) for h in RENDERED_HORIZONTAL_MM for v in VERTICAL_MM]
    return [
        Shot(work / f"pose_{pose.vertical_mm:.2f}_{pose.horizontal_mm:.2f}.npz", pose, boxes, samples.boxes)
        for pose in poses
        if pose != OPEN
    ]
