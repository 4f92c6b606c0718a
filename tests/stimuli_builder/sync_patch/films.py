"""Films of a screen with a sync patch as a phone takes them: tilted, blurred, noisy, compressed."""

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from stimuli_builder.sync_patch import film as patch_code

SCREEN_WIDTH, SCREEN_HEIGHT, FIELD, RIM = 480, 360, 30, 30
CORNERS = np.array([[0, 0], [SCREEN_WIDTH, 0], [SCREEN_WIDTH, SCREEN_HEIGHT], [0, SCREEN_HEIGHT]], np.float32)
TILTED = np.array([[70, 40], [430, 70], [400, 320], [95, 300]], np.float32)
FILM_SIZE = (480, 360)
LEAD_MS = 120.0


@dataclass(frozen=True)
class Shown:
    """A clip's frames on the screen: the onset of each in ms, and when the last one went."""

    onsets_ms: dict[int, float]
    ended_ms: float

    def at(self, time_ms: float) -> int | None:
        """The frame on the screen then; None where there is none."""
        if time_ms >= self.ended_ms:
            return None
        return max((frame for frame, onset in self.onsets_ms.items() if onset <= time_ms), default=None)


def steady(frames: int, fps: float, start_ms: float = LEAD_MS) -> Shown:
    """Every frame on time."""
    onsets = {frame: start_ms + 1000 * frame / fps for frame in range(frames)}
    return Shown(onsets, start_ms + 1000 * frames / fps)


def screen(number: int | None, shade: int) -> NDArray[np.uint8]:
    """The page: a grey surround, a clip whose brightness varies, and the patch in its lower left corner."""
    picture = np.full((SCREEN_HEIGHT, SCREEN_WIDTH), 128, np.uint8)
    picture[40:320, 20:460] = shade
    white = np.ones(patch_code.FIELDS, np.bool_) if number is None else patch_code.fields_of_number(number)
    top, left = 320 - 2 * RIM - 3 * FIELD, 20
    picture[top:320, left : left + 2 * RIM + 3 * FIELD] = 0
    for field in np.flatnonzero(white):
        y, x = top + RIM + FIELD * (int(field) // 3), left + RIM + FIELD * (int(field) % 3)
        picture[y : y + FIELD, x : x + FIELD] = 255
    return picture


@dataclass(frozen=True)
class Camera:
    """A phone: pictures a second, exposure as a share of that, how long the shutter rolls down a picture."""

    fps: float = 240.0
    exposure: float = 0.5
    rolling_ms: float = 3.0
    noise: float = 6.0
    turns: int = 0
    phase_ms: float = 1.3
    crf: int = 28


def film(path: Path, shown: Shown, camera: Camera, until_ms: float) -> Path:
    """Write the film; each picture's rows are taken one after the other, each over the exposure."""
    random = np.random.default_rng(7)
    warp = cv2.getPerspectiveTransform(CORNERS, TILTED)
    count = int((until_ms - camera.phase_ms) * camera.fps / 1000)
    cache: dict[int | None, NDArray[np.float64]] = {}
    with av.open(str(path), "w", options={"movflags": "+faststart"}) as container:
        stream = container.add_stream(
            "libx264", rate=Fraction(camera.fps), options={"crf": str(camera.crf), "preset": "ultrafast"}
        )
        stream.width, stream.height = FILM_SIZE if camera.turns % 2 == 0 else FILM_SIZE[::-1]
        stream.pix_fmt = "yuv420p"
        for number in range(count):
            picture = _taken(shown, camera, camera.phase_ms + 1000 * number / camera.fps, warp, cache)
            noisy = picture + random.normal(0, camera.noise, picture.shape)
            turned = np.rot90(np.clip(noisy, 0, 255).astype(np.uint8), camera.turns)
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(turned), format="gray")
            frame.pts = number
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


BANDS, MOMENTS = 6, 3


def _taken(
    shown: Shown,
    camera: Camera,
    at_ms: float,
    warp: NDArray[np.float64],
    cache: dict[int | None, NDArray[np.float64]],
) -> NDArray[np.float64]:
    """One picture: bands of rows, each the mean over its exposure."""
    height = FILM_SIZE[1]
    picture = np.empty((height, FILM_SIZE[0]))
    for band in range(BANDS):
        rows = slice(height * band // BANDS, height * (band + 1) // BANDS)
        start = at_ms + camera.rolling_ms * band / BANDS
        moments = [start + camera.exposure * 1000 / camera.fps * part / MOMENTS for part in range(MOMENTS)]
        seen = [_straight(shown.at(moment), warp, cache)[rows] for moment in moments]
        picture[rows] = np.mean(seen, axis=0)
    return picture


def _straight(
    number: int | None, warp: NDArray[np.float64], cache: dict[int | None, NDArray[np.float64]]
) -> NDArray[np.float64]:
    if number not in cache:
        shade = 110 if number is None else 80 + 7 * (number % 12)
        tilted = cv2.warpPerspective(screen(number, shade), warp, FILM_SIZE, borderValue=40)
        cache[number] = cv2.GaussianBlur(tilted, (0, 0), 1.2).astype(np.float64)
    return cache[number]
