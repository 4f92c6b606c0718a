"""A face that looks about, turns its head, frowns and may wear glasses; its points in the picture."""

from dataclasses import replace

import numpy as np

from face_baking.eyes import Mesh, tube
from face_baking.framing import Framing
from face_baking.hair import Strands
from face_baking.identity import Identity
from face_baking.kit import Array, FaceKit
from face_baking.lid_loops import SIDES
from face_baking.lid_pose import LidPose
from face_baking.scene import FaceScene, Part
from face_baking.training.draw import SamplePose

TURNED = Framing(150.0, 0.0, (480, 240), (-99, -9, -7), (99, 14, 99), 2)
"""As the framing of the eyes, with so much of the head that a turned one shows no edge."""
_RIM_CM = (2.55, 1.95)
_RIM_AHEAD_CM, _RIM_THICK_CM = 1.3, 0.11
_OUT_OF_SIGHT = np.array([0.0, -500.0, 0.0])


class SampleScene(FaceScene):
    """One identity; poses are `SamplePose`s, all others are taken as those of a resting face."""

    def __init__(self, kit: FaceKit, identity: Identity, size_px: tuple[int, int]) -> None:
        super().__init__(kit, identity, TURNED, size_px)

    def shapes(self, pose: LidPose) -> list[Part]:
        """The parts turned with the head."""
        sample = pose if isinstance(pose, SamplePose) else SamplePose(pose.closure)
        self.express(sample)
        parts = [*super().shapes(pose), Part("spectacles", "spectacles", self._glasses(sample.glasses))]
        return [replace(part, shape=self._turned(part.shape, sample)) for part in parts]

    def strokes_of(self, pose: LidPose) -> dict[int, float]:
        """Each eye's stroke, with a separate closure."""
        if not isinstance(pose, SamplePose):
            return super().strokes_of(pose)
        closures = {1: pose.closure, -1: pose.closure_right}
        return {side: self.strokes.of(closure)[side] for side, closure in closures.items()}

    def turn(self, points: Array, pose: SamplePose) -> Array:
        """(..., 3) points of the resting head where the turned head has them."""
        yaw, pitch, roll = np.radians(pose.turn)
        left = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
        up = np.array([[1, 0, 0], [0, np.cos(pitch), np.sin(pitch)], [0, -np.sin(pitch), np.cos(pitch)]])
        tilt = np.array([[np.cos(roll), -np.sin(roll), 0], [np.sin(roll), np.cos(roll), 0], [0, 0, 1]])
        middle = (self.path.globes[1].centre + self.path.globes[-1].centre) / 2
        return np.asarray((points - middle) @ (tilt @ left @ up).T + middle)

    def express(self, pose: SamplePose) -> None:
        """Let the eyes look, and the face frown, as the pose says; geometry asked for afterwards has it."""
        self.path.look = pose.gaze
        weights = {"browDown": pose.brow, "cheekSquint": pose.cheek, "eyeSquint": pose.squint}
        shapes = self.path.kit.expressions
        whole = sum(w * shapes[f"{name}_{tag}"] for name, w in weights.items() for tag in "LR")
        self.path.expression = np.asarray(whole, np.float64)

    def _turned(self, shape: Mesh | Strands, pose: SamplePose) -> Mesh | Strands:
        if isinstance(shape, Strands):
            return replace(shape, points=self.turn(shape.points, pose))
        return replace(shape, vertices=self.turn(shape.vertices, pose))

    def _glasses(self, worn: bool) -> Mesh:
        """Two rims and a bridge as closed tubes; out of sight where they are not worn."""
        angle = np.linspace(0, 2 * np.pi, 97)
        # A superellipse: rounder than a rectangle, squarer than an ellipse.
        x, y = (np.sign(f) * np.abs(f) ** 0.7 for f in (np.cos(angle), np.sin(angle)))
        lines = []
        for side in SIDES:
            centre = self.path.globes[side].centre + np.array([0, -0.2, 0])
            ahead = self.path.globes[side].radius + _RIM_AHEAD_CM
            lines.append(centre + np.stack([_RIM_CM[0] * x, _RIM_CM[1] * y, np.full_like(x, ahead)], -1))
        ends = [line[np.argmin(np.abs(line[:, 0]))] + np.array([0, 0.6, 0]) for line in lines]
        share = np.linspace(0, 1, 13)[:, None]
        arch = np.array([0, 0.25, 0.1]) * np.sin(np.pi * share)
        lines.append(ends[0] * (1 - share) + ends[1] * share + arch)
        meshes = [tube(line, np.full(len(line), _RIM_THICK_CM)) for line in lines]
        starts = np.cumsum([0, *[len(mesh.vertices) for mesh in meshes[:-1]]])
        vertices = np.concatenate([mesh.vertices for mesh in meshes])
        quads = np.concatenate([mesh.quads + start for mesh, start in zip(meshes, starts, strict=True)])
        return Mesh(vertices if worn else vertices + _OUT_OF_SIGHT, quads)
