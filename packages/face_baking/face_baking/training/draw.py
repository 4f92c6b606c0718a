"""What a sample shows: drawn from its number, so that a stopped run goes on as it would have."""

from dataclasses import dataclass

import numpy as np

from face_baking.lid_pose import LidPose

PER_FACE = 8
"""Samples of one face: building its scene takes longer than a small picture."""
MAX_GAZE, MAX_TURN = 30.0, 30.0
GLASSES_SHARE = 0.25
LIGHTS = ("studio", "window")


@dataclass(frozen=True)
class SamplePose(LidPose):
    """Lids, eyes, face and head. Degrees; left and right are the person's; `closure` is the left eye's.

    Attributes
    ----------
    closure_right : float
        Closure of the right eye.
    gaze : (float, float)
        (left, up), of the eyes in the head.
    turn : (float, float, float)
        (left, up, tilt) of the head.
    brow, cheek, squint : float
        Weights of the kit's expressions.
    glasses : bool
        Whether rims are worn (no lenses).
    """

    closure_right: float = 0.0
    gaze: tuple[float, float] = (0.0, 0.0)
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    brow: float = 0.0
    cheek: float = 0.0
    squint: float = 0.0
    glasses: bool = False


@dataclass(frozen=True)
class Sample:
    """One picture to make: pose, exposure in EV, gain of red and blue, JPEG quality in 1-100."""

    pose: SamplePose
    exposure_ev: float
    warmth: float
    quality: int


def draw_sample(seed: int, number: int) -> Sample:
    """The sample of this number. Looking down lowers the upper lid; one in six eyes closes alone."""
    rng = np.random.default_rng([seed, 31, number])
    gaze = rng.uniform(-MAX_GAZE, MAX_GAZE, 2)
    turn = rng.uniform(-MAX_TURN, MAX_TURN, 3) * (1.0, 0.7, 0.4)
    lowered = 0.4 * max(0.0, -gaze[1]) / MAX_GAZE
    drawn = rng.choice([0.0, 1.0, rng.uniform(0, 1)], p=[0.25, 0.1, 0.65])
    closure = max(float(drawn), lowered)
    other = closure if rng.random() > 1 / 6 else max(float(rng.uniform(0, 1)), lowered)
    brow, cheek, squint = rng.uniform(0, 0.5, 3) * (rng.random(3) < 0.4)
    pose = SamplePose(
        closure=round(closure, 4),
        closure_right=round(other, 4),
        gaze=(round(float(gaze[0]), 2), round(float(gaze[1]), 2)),
        turn=(round(float(turn[0]), 2), round(float(turn[1]), 2), round(float(turn[2]), 2)),
        brow=round(float(brow), 3),
        cheek=round(float(cheek), 3),
        squint=round(float(squint), 3),
        glasses=bool(rng.random() < GLASSES_SHARE),
    )
    return Sample(
        pose,
        exposure_ev=round(float(rng.normal(0, 0.35)), 3),
        warmth=round(float(rng.normal(0, 0.06)), 3),
        quality=int(rng.integers(35, 96)),
    )


def face_of(seed: int, number: int) -> tuple[int, str]:
    """Seed of the identity that a sample shows, and its light."""
    rng = np.random.default_rng([seed, 32, number // PER_FACE])
    return int(rng.integers(1, 1_000_000)), str(rng.choice(LIGHTS))
