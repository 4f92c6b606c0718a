"""The synthetic recording: frames, exact truth of every frame, and label files of a few."""

import csv
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from experiments.files import whole_text
from stimuli_builder.actor import renderer
from stimuli_builder.actor.face import (
    EYE_CENTRES,
    EYE_WIDTH_PX,
    PICTURE_SIZE,
    head_matrix,
    landmarks,
    lid_distances,
)
from stimuli_builder.actor.renderer import draw_eye
from stimuli_builder.video import Picture, VideoWriter

# When and how the synthetic actor blinks, holds the head and looks: published statistics, one seed.
#
# Sources: VanderWerf et al. 2003 (phases), Doughty 2001 (rate), Ousler et al. 2014 and the paper (complete
# and partial blinks); the table is in docs/explanation/tracking.md.

Values = NDArray[np.float64]

DOWN_MS = (92.0, 17.0)
UP_MS = (242.0, 55.0)
INTERVAL_MEDIAN_S = 3.4
INTERVAL_LOG_SD = 0.87
SHORTEST_INTERVAL_S = 0.55
FIRST_BLINK_S = (0.25, 0.6)
COMPLETE_SHARE = 0.5
PARTIAL_DEPTH = (0.30, 0.92)
FAST_SHARE = 0.72
SETTLED = 0.95
ONSET = 0.05


@dataclass(frozen=True)
class Blink:
    """One blink of the plan.

    Attributes
    ----------
    apex_s : float
        Time of greatest closure.
    down_s, up_s : float
        From 5% of the amplitude to the apex, and from the apex to 95% recovery.
    depth : float
        Closure at the apex, 1 for a complete blink.
    """

    apex_s: float
    down_s: float
    up_s: float
    depth: float


def plan_blinks(seconds: float, rng: np.random.Generator) -> list[Blink]:
    """Blinks of a recording: log-normal intervals, half of them complete."""
    blinks: list[Blink] = []
    apex = float(rng.uniform(*FIRST_BLINK_S))
    while apex < seconds - 0.05:
        down = float(np.clip(rng.normal(*DOWN_MS), 50, 150)) / 1000
        up = float(np.clip(rng.normal(*UP_MS), 120, 420)) / 1000
        complete = len(blinks) == 0 or rng.random() < COMPLETE_SHARE
        depth = 1.0 if complete else float(rng.uniform(*PARTIAL_DEPTH))
        blinks.append(Blink(apex, down, up, depth))
        pause = float(rng.lognormal(np.log(INTERVAL_MEDIAN_S), INTERVAL_LOG_SD))
        apex += max(pause, SHORTEST_INTERVAL_S + up)
    return blinks


def _septic(x: Values) -> Values:
    """Smooth step whose first three derivatives vanish at 0 and 1."""
    x = np.clip(x, 0, 1)
    return np.asarray(x**4 * (35 - 84 * x + 70 * x**2 - 20 * x**3))


SEPTIC_ONSET = float(np.interp(ONSET, _septic(np.linspace(0, 1, 4001)), np.linspace(0, 1, 4001)))


def _recovery(t: Values, up_s: float) -> Values:
    """Reopening, 0 to 1: a fast part and a slow tail, 95% reached after `up_s`."""
    # From (1 - FAST_SHARE) exp(-up_s / slow_s) = 1 - SETTLED.
    slow_s = up_s / np.log((1 - FAST_SHARE) / (1 - SETTLED))
    rise = _septic(t / (0.84 * up_s))
    tail = (1 - np.exp(-np.maximum(t, 0) / slow_s)) * _septic(t / (0.6 * up_s))
    return np.asarray(FAST_SHARE * rise + (1 - FAST_SHARE) * tail)


def blink_closure(times_s: Values, blink: Blink) -> Values:
    """Closure this blink adds at each time, 0 to its depth."""
    # The plan counts from 5% of the depth, where the step has begun already.
    length = blink.down_s / (1 - SEPTIC_ONSET)
    down = _septic((times_s - blink.apex_s) / length + 1)
    up = 1 - _recovery(times_s - blink.apex_s, blink.up_s)
    return np.asarray(blink.depth * np.where(times_s <= blink.apex_s, down, up))


@dataclass(frozen=True)
class Course:
    """The plan sampled in time; every array (samples,) unless said otherwise.

    Attributes
    ----------
    closure : float64 array (samples, 2)
        Per eye: 0 open, 1 closed.
    blink : int
        Blink number from 1, 0 between blinks.
    phase : str array
        'open', 'down' or 'up'.
    head : float64 array (samples, 4)
        Shift x and y in pixels, turn in radians, scale.
    gaze : float64 array (samples, 2)
        Shift of the iris in eye widths.
    light : float64 array
        Gain of the lighting.
    """

    times_s: Values
    closure: Values
    blink: NDArray[np.int64]
    phase: NDArray[np.str_]
    head: Values
    gaze: Values
    light: Values


def course(times_s: Values, blinks: list[Blink], seed: int) -> Course:
    """Sample plan, head, gaze and light at ascending times; the same seed gives the same course."""
    rng = np.random.default_rng([seed, 2])
    both = np.zeros((len(times_s), 2))
    for blink in blinks:
        start, stop = np.searchsorted(times_s, [blink.apex_s - 0.4, blink.apex_s + 2.5])
        part = times_s[start:stop]
        lag, share = rng.normal(0, 0.0012), rng.normal(0, 0.015)
        both[start:stop, 0] = np.maximum(both[start:stop, 0], blink_closure(part, blink))
        other = blink_closure(part + lag, blink) * (1.0 if blink.depth == 1 else 1 + share)
        both[start:stop, 1] = np.maximum(both[start:stop, 1], other)
    # The lid wanders less as it closes, and not at all when it is shut.
    rest = 0.035 * _wander(times_s, rng, (4, 23))
    number, phase = _phases(times_s, blinks)
    return Course(
        times_s=times_s,
        closure=np.clip(both + rest[:, None] * (1 - both), -0.1, 1.0),
        blink=number,
        phase=phase,
        head=_head(times_s, rng),
        gaze=0.012 * np.stack([_wander(times_s, rng, (1.5, 9)) for _ in range(2)], axis=1),
        light=1 + 0.012 * _wander(times_s, rng, (5, 40)),
    )


def _phases(times_s: Values, blinks: list[Blink]) -> tuple[NDArray[np.int64], NDArray[np.str_]]:
    number = np.zeros(len(times_s), np.int64)
    phase = np.full(len(times_s), "open")
    for count, blink in enumerate(blinks, start=1):
        down = (times_s >= blink.apex_s - blink.down_s) & (times_s <= blink.apex_s)
        up = (times_s > blink.apex_s) & (times_s <= blink.apex_s + blink.up_s)
        number[down | up] = count
        phase[down], phase[up] = "down", "up"
    return number, phase


def _head(times_s: Values, rng: np.random.Generator) -> Values:
    shift_x, shift_y = (5.0 * _wander(times_s, rng, (2.5, 17)) for _ in range(2))
    turn = np.radians(1.0) * _wander(times_s, rng, (3, 19))
    return np.stack([shift_x, shift_y, turn, 1 + 0.012 * _wander(times_s, rng, (4, 21))], axis=1)


def _wander(times_s: Values, rng: np.random.Generator, periods_s: tuple[float, float]) -> Values:
    """A smooth, bounded, aperiodic signal of about unit amplitude."""
    total = np.zeros(len(times_s))
    for _ in range(5):
        period, phase = rng.uniform(*periods_s), rng.uniform(0, 2 * np.pi)
        total += np.sin(2 * np.pi * times_s / period + phase)
    # A sum of five sines grows by the root of their number.
    return np.asarray(total / np.sqrt(5))


SHUTTER = 0.5
FINE = 8
BOX = (-0.80, 0.80, -0.52, 0.50)
SKIN_CHROMA = (112.0, 146.0)
NOISE_TILE = (1024, 1280)


@dataclass(frozen=True)
class ActorOptions:
    """What `stimuli actor` is asked for; noise in gray levels (sd)."""

    seconds: float = 20.0
    fps: float = 300.0
    seed: int = 1
    noise: float = 2.0

    def __post_init__(self) -> None:
        if not 0.1 <= self.seconds <= 7200:
            raise InputError(f"--seconds {self.seconds:g}: expected 0.1 to 7200")
        if not 10 <= self.fps <= 2000:
            raise InputError(f"--fps {self.fps:g}: expected 10 to 2000")
        if not 0 <= self.noise <= 50:
            raise InputError(f"--noise {self.noise:g}: expected 0 to 50 gray levels")

    @property
    def frame_count(self) -> int:
        """Number of frames of the recording."""
        return max(1, round(self.seconds * self.fps))


class Actor:
    """A face with a fixed look (seed), drawn at any moment of its course."""

    def __init__(self, options: ActorOptions):
        rng = np.random.default_rng([options.seed, 1])
        self.options = options
        self._face, self._lid = renderer.face_texture(rng), renderer.lid_texture(rng)
        self._iris, self._lashes = renderer.iris_texture(rng), renderer.lash_texture(rng)
        self._noise = (options.noise * rng.standard_normal(NOISE_TILE)).astype(np.float32)
        self._places = np.random.default_rng([options.seed, 3])
        blinks = plan_blinks(options.seconds, np.random.default_rng([options.seed, 4]))
        # From half a frame before: sample number * FINE + FINE / 2 is at the time of a frame.
        fine_s = (np.arange(options.frame_count * FINE) - FINE // 2) / (options.fps * FINE)
        self._fine = course(fine_s, blinks, options.seed)
        self.course = course(np.arange(options.frame_count) / options.fps, blinks, options.seed)

    def frame(self, number: int) -> tuple[Picture, Picture]:
        """Luminance (h, w) and the two chroma planes of one frame, (h / 2, w / 2) each stacked."""
        now = self.course
        matrix = head_matrix(now.head[number])
        inverse = np.asarray(cv2.invertAffineTransform(matrix))
        width, height = PICTURE_SIZE
        shift = np.array([[1.0, 0, -renderer.MARGIN_PX], [0, 1.0, -renderer.MARGIN_PX], [0, 0, 1]])
        picture = cv2.warpAffine(self._face, matrix @ shift, (width, height), flags=cv2.INTER_LINEAR)
        picture = np.asarray(picture * np.float32(now.light[number]), np.float32)
        cover = np.zeros((height, width), np.float32)
        for eye in range(2):
            self._eye(picture, cover, eye, number, matrix, inverse)
        return self._exposed(picture), _chroma(cover)

    def _eye(
        self,
        picture: NDArray[np.float32],
        cover: NDArray[np.float32],
        eye: int,
        number: int,
        matrix: Values,
        inverse: Values,
    ) -> None:
        x0, x1, y0, y1 = _box(EYE_CENTRES[eye], matrix)
        part, seen = np.zeros((y1 - y0, x1 - x0), np.float32), cover[y0:y1, x0:x1]
        closures = self._exposures(number, eye)
        now = self.course
        draw: Any = draw_eye
        for closure in closures:
            draw(
                part, seen, x0, y0, inverse, np.array(EYE_CENTRES[eye]), 1.0 - 2.0 * eye,
                EYE_WIDTH_PX, closure, now.gaze[number], now.light[number], self._face,
                float(renderer.MARGIN_PX), self._lid, self._iris, self._lashes, 1.0 / len(closures),
            )  # fmt: skip
        picture[y0:y1, x0:x1] = part

    def _exposures(self, number: int, eye: int) -> Values:
        """Closures over the time the shutter is open, centered on the frame's time: one if the lid rests."""
        reach = int(FINE * SHUTTER / 2)
        middle = number * FINE + FINE // 2
        open_time = self._fine.closure[max(middle - reach, 0) : middle + reach + 1, eye]
        if np.ptp(open_time) * 0.36 * EYE_WIDTH_PX < 0.08:
            return self.course.closure[number : number + 1, eye]
        return open_time

    def _exposed(self, picture: NDArray[np.float32]) -> Picture:
        height, width = picture.shape
        y, x = self._places.integers(0, [NOISE_TILE[0] - height, NOISE_TILE[1] - width])
        noisy = picture + self._noise[y : y + height, x : x + width]
        return np.asarray(cv2.convertScaleAbs(np.maximum(noisy, 0)), np.uint8)


def _box(centre: tuple[float, float], matrix: Values) -> tuple[int, int, int, int]:
    u0, u1, v0, v1 = BOX
    corners = np.array([(u, v) for u in (u0, u1) for v in (v0, v1)]) * EYE_WIDTH_PX + centre
    placed = corners @ matrix[:, :2].T + matrix[:, 2]
    limits = np.array(PICTURE_SIZE)
    x0, y0 = np.clip(np.floor(placed.min(0)), 0, limits).astype(int)
    x1, y1 = np.clip(np.ceil(placed.max(0)) + 1, 0, limits).astype(int)
    return int(x0), int(x1), int(y0), int(y1)


def _chroma(cover: NDArray[np.float32]) -> Picture:
    height, width = cover.shape
    half = cv2.resize(cover, (width // 2, height // 2), interpolation=cv2.INTER_AREA)
    planes = [tint + (128 - tint) * 0.8 * half for tint in SKIN_CHROMA]
    return np.asarray(np.concatenate([np.round(p) for p in planes]).astype(np.uint8))


def write_video(actor: Actor, path: Path, advance: Callable[[], None]) -> None:
    """Draw and encode every frame; `advance` is called after each."""
    with VideoWriter(path, actor.options.fps, PICTURE_SIZE, crf=18) as writer:
        for number in range(actor.options.frame_count):
            luma, chroma = actor.frame(number)
            planes = np.concatenate([luma.reshape(-1), chroma.reshape(-1)]).reshape(-1, PICTURE_SIZE[0])
            writer.write_planes(planes)
            advance()


def truth_header() -> list[str]:
    """Columns of the truth table: the track's points and distances, then closure, blink and phase."""
    points = [f"{axis}{point:02d}" for point in range(1, 19) for axis in "xy"]
    return ["frame", "time_s", *points, "left_distance_px", "right_distance_px", "closure", "blink", "phase"]


def truth_points(now: Course) -> Iterator[Values]:
    """Exact landmarks of every frame, (18, 2) each."""
    for closure, head in zip(now.closure, now.head, strict=True):
        yield landmarks(closure, head)


def write_truth(actor: Actor, path: Path) -> None:
    """Write the exact landmarks, distances, closure (mean of both eyes), blink number and phase as CSV."""
    now = actor.course
    with whole_text(path) as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(truth_header())
        for number, points in enumerate(truth_points(now)):
            distances = [f"{value:.4f}" for value in (*points.reshape(-1), *lid_distances(points))]
            blink = int(now.blink[number]) or ""
            closure = f"{now.closure[number].mean():.5f}"
            writer.writerow(
                [number, f"{now.times_s[number]:.6f}", *distances, closure, blink, now.phase[number]]
            )


def choose_frames(now: Course, count: int, within: int = 20_000) -> list[int]:
    """Frames a person would label: as different from one another as possible, starting from an open eye."""
    numbers = np.arange(0, min(len(now.times_s), within), max(1, len(now.times_s) // 4000))
    closed = now.closure[numbers]
    features = np.c_[3 * closed, now.head[numbers, :2] / 20, now.head[numbers, 2:] * [20, 0] + [0, 0]]
    chosen = [int(np.argmin(np.abs(closed.mean(1) - np.median(closed))))]
    distance = np.full(len(numbers), np.inf)
    while len(chosen) < min(count, len(numbers)):
        distance = np.minimum(distance, ((features - features[chosen[-1]]) ** 2).sum(1))
        chosen.append(int(distance.argmax()))
    return sorted(int(numbers[index]) for index in chosen)


def label_points(actor: Actor, count: int, noise_px: float) -> dict[int, Values]:
    """Landmarks of chosen frames, with normal error of `noise_px` in each coordinate."""
    rng = np.random.default_rng([actor.options.seed, 5])
    now = actor.course
    return {
        number: landmarks(now.closure[number], now.head[number])
        + rng.normal(0, noise_px, (18, 2)) * (noise_px > 0)
        for number in choose_frames(now, count)
    }
