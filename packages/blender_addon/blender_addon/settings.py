"""What the panel asks for, kept with each object."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

STATES = [
    ("rest", "At rest", "17 blinks per minute"),
    ("listening", "Listening", "As at rest"),
    ("speaking", "Speaking", "26 blinks per minute"),
    ("reading", "Reading", "4.5 blinks per minute"),
    ("screen", "At a screen", "7 blinks per minute"),
]
MOTIONS = [("ROTATION", "Turns", "The lid's bone turns"), ("LOCATION", "Shifts", "The lid's bone shifts")]
AXES = [(axis, axis, f"Local {axis} axis") for axis in "XYZ"]
DENSITIES = [
    ("EVERY_FRAME", "Every frame", "Exact curve: one key per frame of a blink, none between blinks"),
    ("FEW", "Few", "Four smooth keys per blink, easier to edit"),
]


class PalpebraGuess(bpy.types.PropertyGroup):
    """A row of the table of guesses."""

    title: StringProperty()  # type: ignore[valid-type]
    left: StringProperty()  # type: ignore[valid-type]
    right: StringProperty()  # type: ignore[valid-type]


class PalpebraSettings(bpy.types.PropertyGroup):
    """Settings of one object."""

    left: StringProperty(name="Left eye", description="Shape key or bone that closes the left eye")  # type: ignore[valid-type]
    right: StringProperty(  # type: ignore[valid-type]
        name="Right eye", description="Use the left eye's name if one shape closes both eyes"
    )
    guesses: CollectionProperty(type=PalpebraGuess)  # type: ignore[valid-type]
    state: EnumProperty(name="State", items=STATES, default="rest")  # type: ignore[valid-type]
    seed: IntProperty(name=("Seed"), default=1, min=0, description="A different seed gives different blinks")  # type: ignore[valid-type]
    rate: FloatProperty(  # type: ignore[valid-type]
        name="Blinks a minute", default=0.0, min=0.0, max=60.0, description="0 uses the rate of the state"
    )
    density: EnumProperty(name="Keys", items=DENSITIES, default="EVERY_FRAME")  # type: ignore[valid-type]
    hold: BoolProperty(  # type: ignore[valid-type]
        name="Eyes stay open",
        default=False,
        description="Key this flag: blinks come while it is off, and the eyes stay open while it is on",
    )
    replace: BoolProperty(  # type: ignore[valid-type]
        name="Replace my own keys",
        default=False,
        description="If off, keys that you set yourself are never changed",
    )
    sound: StringProperty(name="Speech", subtype="FILE_PATH", description="A recording of the voice")  # type: ignore[valid-type]
    sound_start: IntProperty(name="Starts at frame", default=1)  # type: ignore[valid-type]
    bone_motion: EnumProperty(name="Bone", items=MOTIONS, default="ROTATION")  # type: ignore[valid-type]
    bone_axis: EnumProperty(name="Axis", items=AXES, default="X")  # type: ignore[valid-type]
    bone_closed_rad: FloatProperty(name="Shut at", subtype="ANGLE", default=0.0)  # type: ignore[valid-type]
    bone_closed_m: FloatProperty(name="Shut at", subtype="DISTANCE", default=0.0, precision=4)  # type: ignore[valid-type]


CLASSES = (PalpebraGuess, PalpebraSettings)


def register() -> None:
    """Give every object its settings."""
    for one in CLASSES:
        bpy.utils.register_class(one)
    bpy.types.Object.palpebra = PointerProperty(type=PalpebraSettings)


def unregister() -> None:
    """Take them away again; keys that were written stay."""
    del bpy.types.Object.palpebra
    for one in reversed(CLASSES):
        bpy.utils.unregister_class(one)
