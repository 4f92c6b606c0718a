"""The network: a grey picture (1, 64, 96) to 20 lid points, the iris, and how far each may be off."""

import torch
from torch import Tensor, nn

POINTS = 20
"""Two canthi, nine points of the upper lid, nine of the lower."""
SCALE = 56.0
"""Coordinates are in eye widths of a region that fits, from the picture's middle."""


def block(into: int, out: int, stride: int) -> nn.Sequential:
    """A convolution with what follows it."""
    return nn.Sequential(
        nn.Conv2d(into, out, 3, stride, 1, bias=False), nn.BatchNorm2d(out), nn.ReLU(inplace=True)
    )


class LidNetwork(nn.Module):  # type: ignore[misc]  # torch is in an environment of its own
    """Direct regression; the last grid is small enough to be read whole."""

    def __init__(self) -> None:
        super().__init__()
        self.body = nn.Sequential(
            block(1, 16, 2), block(16, 32, 2), block(32, 32, 1), block(32, 64, 2), block(64, 64, 1),
            block(64, 96, 2), nn.Conv2d(96, 24, 1), nn.ReLU(inplace=True),
        )  # fmt: skip
        self.head = nn.Sequential(
            nn.Flatten(), nn.Linear(24 * 24, 160), nn.ReLU(inplace=True),
            nn.Linear(160, 2 * POINTS + 3 + POINTS + 1),
        )  # fmt: skip

    def forward(self, picture: Tensor) -> Tensor:
        """(n, 64): 20 points (x, y), iris x, y and log radius, log spread of each point and of the iris."""
        return self.head(self.body(picture))


def loss_of(answer: Tensor, points: Tensor, iris: Tensor, seen: Tensor) -> Tensor:
    """Laplace likelihood of points (n, 20, 2) and, where seen (n,), of the iris (n, 3)."""
    n = len(answer)
    at = answer[:, : 2 * POINTS].reshape(n, POINTS, 2)
    disc = answer[:, 2 * POINTS : 2 * POINTS + 3]
    spread = answer[:, 2 * POINTS + 3 :].clamp(-6, 2)
    away = (at - points).square().sum(-1).add(1e-6).sqrt()
    off = (disc - iris).square().sum(-1).add(1e-6).sqrt()
    lids = away * torch.exp(-spread[:, :POINTS]) + 2 * spread[:, :POINTS]
    eye = (off * torch.exp(-spread[:, POINTS]) + 2 * spread[:, POINTS]) * seen
    return lids.mean() + 0.1 * eye.sum() / seen.sum().clamp(min=1)


def contour_error(answer: Tensor, points: Tensor) -> Tensor:
    """(n,) mean distance of the points from where they belong, in eye widths."""
    at = answer[:, : 2 * POINTS].reshape(len(answer), POINTS, 2)
    return (at - points).square().sum(-1).sqrt().mean(-1)
