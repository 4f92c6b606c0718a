"""Key, fill, rims, catch-light and studio. Runs in Blender's own Python: see cycles_worker.py."""

import math
from typing import Any

import bpy
import numpy as np
from mathutils import Vector

Settings = dict[str, Any]
Y_UP_TO_Z_UP = math.radians(90)
WET = ("eye", "cornea", "tear", "flesh")


def add_light(
    name: str, at: tuple[float, ...], size: float, power: float, colour: tuple[float, ...], height: float = 0
) -> Any:
    """A rectangular light of `power` W (in a world of mm) that faces the face's middle."""
    light = bpy.data.lights.new(name, "AREA")
    light.shape, light.size, light.size_y = "RECTANGLE", size, height or size
    light.energy, light.color = power, colour
    thing = bpy.data.objects.new(name, light)
    thing.location = at
    # An area light shines along its own -z: turn that towards the face's middle.
    thing.rotation_euler = (-Vector(at)).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(thing)
    return thing


def add_lights(settings: Settings) -> None:
    """Key, fill, two rims, and a catch-light that only wet surfaces receive."""
    add_light("key", (-300, 330, 560), 330, 4.2e6, (1, 0.965, 0.92))
    add_light("fill", (420, -60, 520), 360, 1.45e6, (0.88, 0.94, 1))
    add_light("rim_left", (-420, 160, -40), 200, 1.1e6, (0.95, 0.97, 1))
    add_light("rim_right", (420, 200, -60), 200, 0.75e6, (1, 0.95, 0.9))
    catch = add_light("catch", (-170, 225, 560), 75, 5.0e6, (1, 0.985, 0.96), 100)
    wet = bpy.data.collections.new("wet")
    for thing in bpy.data.objects:
        if thing.name.split(".")[0] in WET:
            wet.objects.link(thing)
    catch.light_linking.receiver_collection = wet
    catch.visible_diffuse = False
    add_studio(settings["studio"])


def add_studio(strength: float, height: int = 256, width: int = 512) -> None:
    """Soft environment: dim floor, cool ceiling, three soft boxes, a dark patch where the viewer sits."""
    rows, columns = np.mgrid[0:height, 0:width]
    latitude, longitude = (0.5 - (rows + 0.5) / height) * np.pi, ((columns + 0.5) / width - 0.5) * 2 * np.pi
    up = np.clip(np.sin(latitude) * 0.5 + 0.5, 0, 1)[..., None]
    light = np.array([0.10, 0.085, 0.075]) * (1 - up) + np.array([0.36, 0.40, 0.46]) * up
    boxes = (
        (0.9, 1.5, -0.3, 0.8, (0.35, 0.33, 0.30)),
        (-2.4, -1.6, -0.2, 1.0, (0.60, 0.60, 0.62)),
        (1.8, 2.6, -0.2, 0.9, (0.50, 0.46, 0.42)),
        (-0.25, 0.25, -0.45, 0.35, (-0.05, -0.05, -0.05)),
    )
    for west, east, south, north, colour in boxes:
        inside = np.ones((height, width))
        for low, at, high in ((west, longitude, east), (south, latitude, north)):
            inside = inside / (1 + np.exp((low - at) / 0.04)) / (1 + np.exp((at - high) / 0.04))
        light = light + inside[..., None] * np.array(colour)
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = np.clip(light, 0, None)[::-1]
    image = bpy.data.images.new("studio", width, height, float_buffer=True)
    image.pixels.foreach_set(pixels.ravel())
    image.colorspace_settings.name = "Non-Color"
    world = bpy.data.worlds.new("studio")
    bpy.context.scene.world = world
    world.use_nodes = True
    tree = world.node_tree
    place, mapping, texture = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexCoord", "Mapping", "TexEnvironment")
    )
    texture.image = image
    mapping.inputs["Rotation"].default_value = (Y_UP_TO_Z_UP, 0, 0)
    tree.links.new(place.outputs["Generated"], mapping.inputs[0])
    tree.links.new(mapping.outputs[0], texture.inputs[0])
    tree.links.new(texture.outputs[0], tree.nodes["Background"].inputs[0])
    tree.nodes["Background"].inputs[1].default_value = strength
