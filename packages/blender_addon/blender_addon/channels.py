"""What closes an eye in a rig: a value of a shape key, or a turn or a shift of a bone."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from blender_addon.lid_keys import Array, LidKeys

KEY_TYPES = {item.identifier: item.value for item in bpy.types.Keyframe.bl_rna.properties["type"].enum_items}
INTERPOLATIONS = {
    item.identifier: item.value for item in bpy.types.Keyframe.bl_rna.properties["interpolation"].enum_items
}
OURS = KEY_TYPES["GENERATED"]
"""Keys that a tool made: this distinguishes ours from the animator's."""


@dataclass(frozen=True)
class Channel:
    """One animated number.

    Attributes
    ----------
    owner : Any
        bpy ID with the animation: the shape keys' data block, or the armature object.
    path, index : str, int
        Its data path, and the place within a vector; -1 for a single number.
    rest, closed : float
        Its value with the eye open and shut.
    """

    owner: Any
    path: str
    index: int
    rest: float
    closed: float
    title: str

    def curve(self) -> Any:
        """The F-curve, or None where nothing is animated."""
        animation = self.owner.animation_data
        if animation is None or animation.action is None:
            return None
        return next(
            (
                one
                for one in _curves(animation)
                if one.data_path == self.path and one.array_index == max(self.index, 0)
            ),
            None,
        )

    def fault(self) -> str | None:
        """Why nothing can be keyed, in one line."""
        if self.owner.library is not None:
            return f"{self.title} is linked from another file; make a library override of the character first"
        animation = self.owner.animation_data
        if animation is not None and any(
            driver.data_path == self.path and driver.array_index == max(self.index, 0)
            for driver in animation.drivers
        ):
            return f"{self.title} is driven by another value; choose its control, or remove the driver"
        curve = self.curve()
        if curve is not None and (curve.lock or (curve.group is not None and curve.group.lock)):
            return f"the channel of {self.title} is locked; unlock it in the graph editor"
        return None

    def own_keys(self) -> tuple[Array, Array]:
        """Frames of the animator's own keys and of ours, each ascending."""
        curve = self.curve()
        if curve is None:
            return np.empty(0), np.empty(0)
        frames, ours = _frames(curve), _types(curve) == OURS
        return frames[~ours], frames[ours]


def write_keys(channel: Channel, keys: LidKeys, start: float, end: float, smooth: bool) -> None:
    """Put keys on a channel between two frames, in place of those that we wrote there before.

    The animator's own keys within the stretch go too: who calls has asked for that.
    """
    curve = channel.curve()
    if curve is None:
        channel.owner.keyframe_insert(channel.path, index=channel.index, frame=start)
        curve = channel.curve()
        curve.keyframe_points.clear()
    kept = [
        (point.co[0], point.co[1], KEY_TYPES[point.type], INTERPOLATIONS[point.interpolation])
        for point in curve.keyframe_points
        if not start - 0.5 <= point.co[0] <= end + 0.5
    ]
    value = channel.rest + keys.values * (channel.closed - channel.rest)
    joined = INTERPOLATIONS["BEZIER" if smooth else "LINEAR"]
    made = np.column_stack([keys.frames, value, np.full(value.size, OURS), np.full(value.size, joined)])
    every = np.concatenate([np.reshape(kept, (-1, 4)), made])
    every = every[np.argsort(every[:, 0], kind="stable")]
    points = curve.keyframe_points
    points.clear()
    points.add(len(every))
    points.foreach_set("co", np.ascontiguousarray(every[:, :2], np.float32).ravel())
    points.foreach_set("type", every[:, 2].astype(np.int32))
    points.foreach_set("interpolation", every[:, 3].astype(np.int32))
    for name in ("handle_left_type", "handle_right_type"):
        points.foreach_set(name, np.full(len(every), 4, np.int32))
    curve.update()


def clear_keys(channel: Channel, start: float, end: float) -> int:
    """Remove the keys that we wrote between two frames; how many there were."""
    curve = channel.curve()
    if curve is None:
        return 0
    ours = [
        point
        for point in curve.keyframe_points
        if KEY_TYPES[point.type] == OURS and start - 0.5 <= point.co[0] <= end + 0.5
    ]
    for point in reversed(ours):
        curve.keyframe_points.remove(point, fast=True)
    curve.update()
    return len(ours)


def _frames(curve: Any) -> Array:
    coordinates = np.empty(2 * len(curve.keyframe_points), np.float32)
    curve.keyframe_points.foreach_get("co", coordinates)
    return coordinates[::2].astype(np.float64)


def _types(curve: Any) -> Any:
    types = np.empty(len(curve.keyframe_points), np.int32)
    curve.keyframe_points.foreach_get("type", types)
    return types


def _curves(animation: Any) -> Sequence[Any]:
    """The F-curves of an action, whether it has layers (Blender 4.4 and later) or not."""
    action = animation.action
    if not getattr(action, "is_action_layered", False):
        return list(action.fcurves)
    slot = animation.action_slot
    bags = [strip.channelbag(slot) for layer in action.layers for strip in layer.strips] if slot else []
    return [curve for bag in bags if bag is not None for curve in bag.fcurves]
