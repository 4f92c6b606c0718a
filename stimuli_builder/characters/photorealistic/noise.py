"""Random fields on the face's texture plane: smooth noise and cells, all drawn from explicit seeds."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from stimuli_builder.characters.photorealistic.eyelid_skin import UV_HEIGHT_MM, UV_WIDTH_MM

Field = NDArray[np.floating[Any]]


@dataclass(frozen=True)
class Plane:
    """The texture plane: 160 x 100 mm; row 0 is the lowest, as texture coordinate v = 0 is."""

    px_per_mm: int
    seed: int

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns) in px."""
        return int(UV_HEIGHT_MM * self.px_per_mm), int(UV_WIDTH_MM * self.px_per_mm)

    @cached_property
    def x(self) -> Field:
        """(rows, columns) mm from the face's middle."""
        across = (np.arange(self.shape[1], dtype=np.float32) + 0.5) / self.px_per_mm - UV_WIDTH_MM / 2
        return np.broadcast_to(across, self.shape).copy()

    @cached_property
    def y(self) -> Field:
        """(rows, columns) mm above the eyes' centres."""
        up = (np.arange(self.shape[0], dtype=np.float32) + 0.5) / self.px_per_mm - UV_HEIGHT_MM / 2
        return np.broadcast_to(up[:, None], self.shape).copy()

    def noise(self, sigma_mm: float, seed: int, stretch: float = 1.0) -> Field:
        """Gaussian-filtered noise of unit deviation; `stretch` > 1 elongates it sideways."""
        sigma = sigma_mm * self.px_per_mm
        coarse = max(1, int(sigma / 3))
        rows, columns = self.shape
        rng = np.random.default_rng([self.seed, seed])
        raw = rng.normal(size=(rows // coarse + 8, columns // coarse + 8)).astype(np.float32)
        smooth = gaussian_filter(raw, (sigma / coarse / stretch, sigma / coarse * stretch))
        smooth = (smooth / smooth.std())[4:-4, 4:-4]
        return np.asarray(
            cv2.resize(smooth, (columns, rows), interpolation=cv2.INTER_CUBIC), dtype=np.float32
        )

    def octaves(self, sigma_mm: float, seed: int, count: int, gain: float = 0.55) -> Field:
        """Sum of ever finer noise, of unit deviation."""
        total = np.zeros(self.shape, np.float32)
        for octave in range(count):
            total += np.float32(gain**octave) * self.noise(sigma_mm / 2**octave, seed + octave)
        return np.asarray(total / total.std(), dtype=np.float32)

    def cells(
        self, cell_mm: float, seed: int, stretch: tuple[float, float] = (1.0, 1.0)
    ) -> tuple[Field, Field, Field]:
        """Worley cells: distance in mm to the nearest and second point, and a random number each."""
        rng = np.random.default_rng([self.seed, seed])
        pitch = (cell_mm * stretch[0], cell_mm * stretch[1])
        count = (int(UV_WIDTH_MM / pitch[0]) + 3, int(UV_HEIGHT_MM / pitch[1]) + 3)
        jitter = 0.95 * (rng.random((2, count[1], count[0])) - 0.5)
        px = (np.arange(count[0]) - 0.5 + jitter[0]) * pitch[0] - UV_WIDTH_MM / 2
        py = (np.arange(count[1])[:, None] - 0.5 + jitter[1]) * pitch[1] - UV_HEIGHT_MM / 2
        tree = cKDTree(np.stack([px.ravel() / stretch[0], py.ravel() / stretch[1]], -1))
        at_x = (self.x + 0.12 * self.noise(1.2, seed + 50)) / stretch[0]
        at_y = (self.y + 0.12 * self.noise(1.2, seed + 60)) / stretch[1]
        found = tree.query(np.stack([at_x.ravel(), at_y.ravel()], -1), k=2, workers=2)
        distance, index = np.asarray(found[0]), np.asarray(found[1])
        label = rng.random(px.size).astype(np.float32)[index[:, 0]]
        near, second = (distance[:, k].reshape(self.shape).astype(np.float32) for k in (0, 1))
        return near, second, label.reshape(self.shape)

    def to_px(self, points_mm: NDArray[np.float64]) -> NDArray[np.int32]:
        """Pixel positions of (k, 2) points in mm, for drawing."""
        offset = np.array([UV_WIDTH_MM / 2, UV_HEIGHT_MM / 2])
        return np.asarray(np.round((points_mm + offset) * self.px_per_mm), dtype=np.int32)
