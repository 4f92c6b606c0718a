"""What is wet of an eye, film and tears, and the lamps it mirrors, in cm. Runs in Blender's own Python."""

import math
from typing import Any

from cycles_face_nodes import Nodes
from mathutils import Vector

FILM_IOR = 1.376
ROOM_MIRRORED = 0.5
"""Share of the room's light that the eyes mirror: half of what lies about them is the face itself."""
ROUNDED = 2.8
"""Exponent of a lamp's outline as the eyes mirror it: 2 is an ellipse, and beyond 8 a square."""
BAR = (0.70, 0.95)
"""Where in a window's pane its bar begins and is whole, from the pane's middle (0) to its edge (1)."""
FLOOR, CEILING = 0.25, 1.7
"""Light of the mirrored room's floor and ceiling over its mean."""
HOT = 1.8
"""Light of a mirrored lamp's middle over that of its rim: the bulb behind a soft box's cloth."""

TEAR_RIPPLES, TEAR_SLOPE = 9.0, 1.6
"""Ripples of the line of tears per cm, and the greatest slope that they give it along the lid: a smooth
tube met the lamps at one place at most, and a lid's margin without glints looks dry."""


def film(lights: dict[str, Any]) -> Any:
    """Clear wet layer: refracts to the camera and shines with what it mirrors, is open to light on its way.

    Mirrored lamps are worked out by their rectangles. As a mirror it would be asked once in forty samples,
    so that at 12 samples a third of a level's error stood on the hundredth part that is catchlight.
    """
    n = Nodes("film")
    coordinates = n.add("TexCoord").outputs["Object"]
    ripples = n.math("MULTIPLY", n.noise(coordinates, 7.0, 3), 0.0011)
    normal = n.add("Bump", Strength=1.0, Distance=1.0, Height=ripples).outputs[0]
    # Seen along it a film mirrors all, but there that is the lids and the nose, not the room.
    mirrored = n.math("MINIMUM", n.add("Fresnel", IOR=FILM_IOR, Normal=normal).outputs[0], 0.06)
    through = n.math("SUBTRACT", 1.0, mirrored)
    ray, clear = n.add("LightPath"), n.add("BsdfTransparent")
    glass = n.add("BsdfRefraction", IOR=FILM_IOR, Roughness=0.0, Normal=normal)
    n.put(n.add("CombineXYZ", X=through, Y=through, Z=through).outputs[0], glass.inputs["Color"])
    shine = n.add("Emission", Color=reflected(n, normal, lights))
    n.put(n.math("MULTIPLY", mirrored, ray.outputs["Is Camera Ray"]), shine.inputs["Strength"])
    seen, mix = n.add("AddShader"), n.add("MixShader")
    n.put(glass.outputs[0], seen.inputs[0])
    n.put(shine.outputs[0], seen.inputs[1])
    n.put(n.math("MAXIMUM", ray.outputs["Is Shadow Ray"], ray.outputs["Is Diffuse Ray"]), mix.inputs[0])
    n.put(seen.outputs[0], mix.inputs[1])
    n.put(clear.outputs[0], mix.inputs[2])
    return n.surface(mix)


def reflected(n: Nodes, normal: Any, lights: dict[str, Any], room: float = ROOM_MIRRORED) -> Any:
    """Light that comes from where a mirror of that normal looks: the room's, and each mirrored lamp's."""
    geometry = n.add("NewGeometry")
    away = n.vector("REFLECT", n.vector("SCALE", geometry.outputs["Incoming"], scale=-1.0), normal)
    up = n.vector("DOT_PRODUCT", away, [0.0, 1.0, 0.0])
    room_light = n.math("MULTIPLY", n.ramp(up, -0.5, 0.8, FLOOR, CEILING), lights["room_strength"] * room)
    total = n.vector("SCALE", lights["room"], scale=room_light)
    for lamp in [*lights["areas"], *lights.get("reflections", [])]:
        if not lamp.get("in_eyes", lamp["mirrored"]):
            continue
        share = _lamp_share(n, geometry.outputs["Position"], away, lamp)
        radiance = lamp["energy"] / (math.pi * lamp["size"][0] * lamp["size"][1])
        colour = [c * radiance for c in lamp["colour"]]
        total = n.vector("ADD", total, n.vector("SCALE", colour, scale=share))
    return total


def _lamp_share(n: Nodes, start: Any, away: Any, lamp: dict[str, Any]) -> Any:
    """1 where a ray meets the lamp, rounded within its rectangle, 0 outside it, with a soft box's edge."""
    centre = Vector(lamp["place"])
    back = (centre - Vector(lamp["aim"])).normalized()
    # Upright, as windows are.
    across = Vector((0, 1, 0)).cross(back).normalized()
    up = back.cross(across)
    towards = n.vector("SUBTRACT", list(centre), start)
    facing = n.vector("DOT_PRODUCT", away, list(back))
    way = n.math("DIVIDE", n.vector("DOT_PRODUCT", towards, list(back)), facing)
    off = n.vector("SUBTRACT", n.vector("SCALE", away, scale=way), towards)
    share = n.math("MULTIPLY", n.math("GREATER_THAN", way, 0.0), n.math("GREATER_THAN", facing, 0.0))
    beside = []
    counts = lamp.get("panes", (1, 1))
    for axis, size, panes in zip((across, up), lamp["size"], counts, strict=True):
        offset = n.vector("DOT_PRODUCT", off, [c * 2 / size for c in axis])
        beside.append(n.math("POWER", n.math("ABSOLUTE", offset), ROUNDED))
        if panes > 1:
            within = n.math("FRACT", n.math("MULTIPLY_ADD", offset, panes / 2, panes / 2))
            edge = n.math("ABSOLUTE", n.math("MULTIPLY_ADD", within, 2.0, -1.0))
            share = n.math("MULTIPLY", share, n.ramp(edge, *BAR, 1.0, 0.35))
    edge = n.math("POWER", n.math("ADD", *beside), 1 / ROUNDED)
    hot = n.ramp(edge, 0.0, 1.0, HOT, 1.0)
    return n.math("MULTIPLY", n.math("MULTIPLY", share, hot), n.ramp(edge, 0.50, 1.15, 1.0, 0.0))


def tear(lights: dict[str, Any]) -> Any:
    """Thin water: it passes what lies behind and shines with the lamps; the lids are all else it mirrors."""
    n = Nodes("tear")
    # The rim of so thin a line would mirror all there is, as white dots that come and go with the samples.
    mirrored, ray = n.math("MINIMUM", n.add("Fresnel", IOR=1.34).outputs[0], 0.09), n.add("LightPath")
    at = n.add("TexCoord").outputs["Object"]
    slope = n.math("MULTIPLY_ADD", n.noise(at, TEAR_RIPPLES, 1), 2 * TEAR_SLOPE, -TEAR_SLOPE)
    along = n.add("CombineXYZ", X=slope, Y=0.0, Z=0.0).outputs[0]
    normal = n.vector("NORMALIZE", n.vector("ADD", n.add("NewGeometry").outputs["Normal"], along))
    shine = n.add("Emission", Color=reflected(n, normal, lights))
    n.put(n.math("MULTIPLY", mirrored, ray.outputs["Is Camera Ray"]), shine.inputs["Strength"])
    both = n.add("AddShader")
    n.put(n.add("BsdfTransparent").outputs[0], both.inputs[0])
    n.put(shine.outputs[0], both.inputs[1])
    return n.surface(both)
