"""Which pictures a bake needs, coarse before fine, so that every finished generation is an atlas."""

from dataclasses import dataclass
from pathlib import Path

from experiments.errors import InputError
from stimuli_builder.characters.facekit.framing import Box
from stimuli_builder.characters.facekit.renderer import Shot

LEVEL_COUNTS = (2, 3, 5, 9, 17, 33, 65, 129)


@dataclass(frozen=True)
class Samples:
    """Cycles samples per pixel of the moving boxes and of the still frame."""

    boxes: int
    frame: int


def closures_of(levels: int) -> list[float]:
    """The evenly spaced closures of an atlas; InputError unless levels is 2^k + 1."""
    if levels not in LEVEL_COUNTS:
        raise InputError(f"levels must be one of {', '.join(map(str, LEVEL_COUNTS))}; it is {levels}")
    return [k / (levels - 1) for k in range(levels)]


def frame_shot(work: Path, size_px: tuple[int, int], samples: Samples) -> Shot:
    """The whole frame with open eyes."""
    return Shot(work / "frame.npz", 0.0, {"frame": (0, 0, *size_px)}, samples.frame)


def level_shot(work: Path, boxes: dict[str, Box], samples: Samples, closure: float) -> Shot:
    """Both eyes at one closure."""
    return Shot(work / f"level_{closure:.6f}.npz", closure, boxes, samples.boxes)


def shots(
    work: Path, size_px: tuple[int, int], boxes: dict[str, Box], samples: Samples, levels: int
) -> list[Shot]:
    """Everything to render: the still frame, both ends, then closures halfway between those before."""
    plan, planned = [frame_shot(work, size_px, samples)], set()
    for count in LEVEL_COUNTS[: LEVEL_COUNTS.index(levels) + 1]:
        fresh = [closure for closure in closures_of(count) if closure not in planned]
        planned |= set(fresh)
        plan += [level_shot(work, boxes, samples, closure) for closure in fresh]
    return plan
