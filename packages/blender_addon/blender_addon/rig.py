"""The object that is selected: what it could blink with, and the channels that were chosen."""

from typing import Any

from blender_addon.channels import Channel
from blender_addon.naming import Guess, guesses

AXES = {"X": 0, "Y": 1, "Z": 2}


class RigError(Exception):
    """Why this rig cannot blink as asked, in one line that says what to do."""


def rig_guesses(rig: Any) -> list[Guess]:
    """What an object may blink with; empty for one without shape keys and bones."""
    return guesses(shape_key_names(rig), bone_names(rig))


def shape_key_names(rig: Any) -> list[str]:
    """Names of a mesh's shape keys, the basis left out."""
    keys = rig.data.shape_keys if rig is not None and rig.type == "MESH" else None
    return [] if keys is None else [block.name for block in keys.key_blocks[1:]]


def bone_names(rig: Any) -> list[str]:
    """Names of an armature's bones."""
    return [bone.name for bone in rig.pose.bones] if rig is not None and rig.type == "ARMATURE" else []


def chosen_channels(rig: Any, settings: Any) -> tuple[Channel, Channel | None]:
    """The channels of the left and the right eye; the right is None where one closes both.

    Raises
    ------
    RigError
        Nothing is selected, a name is not there, or a channel is locked, driven or linked.
    """
    if rig is None or rig.type not in ("MESH", "ARMATURE"):
        raise RigError("select the character's face (a mesh with shape keys) or its armature first")
    if not settings.left or not settings.right:
        raise RigError("choose what closes the left and the right eye; 'Guess names' looks for it")
    make = _shape_channel if rig.type == "MESH" else _bone_channel
    names = [settings.left] if settings.left == settings.right else [settings.left, settings.right]
    channels = [make(rig, name, settings) for name in names]
    for channel in channels:
        if fault := channel.fault():
            raise RigError(fault)
    return channels[0], channels[1] if len(channels) == 2 else None


def _shape_channel(rig: Any, name: str, _settings: Any) -> Channel:
    if name not in shape_key_names(rig):
        raise RigError(f"'{rig.name}' has no shape key '{name}'; choose one that closes the eye")
    block = rig.data.shape_keys.key_blocks[name]
    if block.lock_shape:
        raise RigError(f"shape key '{name}' is locked; unlock it in the shape keys' list")
    closed = min(1.0, block.slider_max)
    path = f'key_blocks["{_escaped(name)}"].value'
    return Channel(rig.data.shape_keys, path, -1, 0.0, closed, f"shape key '{name}'")


def _bone_channel(rig: Any, name: str, settings: Any) -> Channel:
    if name not in bone_names(rig):
        raise RigError(f"'{rig.name}' has no bone '{name}'; choose the bone of the upper lid")
    bone, axis = rig.pose.bones[name], AXES[settings.bone_axis]
    turns = settings.bone_motion == "ROTATION"
    if turns and bone.rotation_mode in ("QUATERNION", "AXIS_ANGLE"):
        raise RigError(
            f"bone '{name}' turns by {bone.rotation_mode.lower()}; set its rotation mode to XYZ Euler"
        )
    locked = bone.lock_rotation[axis] if turns else bone.lock_location[axis]
    motion = "rotation" if turns else "location"
    if locked:
        raise RigError(
            f"{motion} {settings.bone_axis} of bone '{name}' is locked; unlock it in the bone's properties"
        )
    path = f'pose.bones["{_escaped(name)}"].{"rotation_euler" if turns else "location"}'
    closed = settings.bone_closed_rad if turns else settings.bone_closed_m
    if closed == 0.0:
        raise RigError(f"set how far bone '{name}' moves to close the eye; it is 0")
    return Channel(rig, path, axis, 0.0, closed, f"bone '{name}'")


def _escaped(name: str) -> str:
    return name.replace("\\", "\\\\").replace('"', '\\"')
