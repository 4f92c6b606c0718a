"""Render scene files with Cycles: runs under bpy in an environment of its own and imports no Palpebra.

Usage: python cycles_worker.py SETTINGS.json (what renderer.py writes). Jobs arrive as JSON lines on stdin:
{"scene": FILE, "out": FILE.npz, "kind": "beauty"|"eye_mask", "samples": N,
"crops": {NAME: [x, y, width, height], ...}}. Each is answered by one JSON line on stdout:
{"out": FILE, "seconds": S}. Blender's own chatter goes to stderr.
"""

import json
import math
import os
import sys
import time
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Vector

Y_UP_TO_Z_UP = math.radians(90)
Settings = dict[str, Any]
Arrays = dict[str, Any]
WET = ("eye", "cornea", "tear", "flesh")


class Nodes:
    """A material's node tree, with the few words needed to wire it."""

    def __init__(self, name: str) -> None:
        self.material = bpy.data.materials.new(name)
        self.material.use_nodes = True
        self.tree = self.material.node_tree
        self.tree.nodes.clear()
        self.output = self.add("OutputMaterial")

    def add(self, kind: str, **settings: Any) -> Any:
        """Add a shader node; settings are its attributes or, with _ for spaces, its inputs."""
        node = self.tree.nodes.new(f"ShaderNode{kind}")
        for key, value in settings.items():
            if hasattr(node, key):
                setattr(node, key, value)
            else:
                node.inputs[key.replace("_", " ")].default_value = value
        return node

    def link(self, source: Any, target: Any) -> None:
        """Wire an output to an input."""
        self.tree.links.new(source, target)

    def surface(self, node: Any) -> Any:
        """Make a shader the material's surface and return the material."""
        self.link(node.outputs[0], self.output.inputs["Surface"])
        return self.material

    def attribute(self, name: str) -> Any:
        """Output of a per-vertex value."""
        return self.add("Attribute", attribute_name=name).outputs["Fac"]

    def texture(self, file: Path, data: bool) -> Any:
        """Output of an image; `data` leaves its values unconverted."""
        image = bpy.data.images.load(str(file), check_existing=True)
        image.colorspace_settings.name = "Non-Color" if data else "sRGB"
        return self.add("TexImage", image=image, interpolation="Cubic").outputs[0]

    def bump(self, height: Any, distance: float, strength: float) -> Any:
        """Normal of a height map."""
        node = self.add("Bump", Distance=distance, Strength=strength)
        self.link(height, node.inputs["Height"])
        return node.outputs[0]

    def scaled(self, value: Any, factor: float) -> Any:
        """A value times a constant."""
        node = self.add("Math", operation="MULTIPLY")
        node.inputs[1].default_value = factor
        self.link(value, node.inputs[0])
        return node.outputs[0]


def skin_material(settings: Settings) -> Any:
    """Scattering skin; the lid margin is moist and pink."""
    nodes = Nodes("skin")
    textures = Path(settings["textures"])
    shader = nodes.add(
        "BsdfPrincipled", Specular_IOR_Level=0.5, IOR=1.4, Sheen_Weight=0.05, Sheen_Roughness=0.4
    )
    moist = nodes.attribute("margin")
    colour = nodes.add("Mix", data_type="RGBA")
    colour.inputs[7].default_value = (*settings["margin_colour"], 1)
    nodes.link(moist, colour.inputs[0])
    nodes.link(nodes.texture(textures / "skin_colour.png", False), colour.inputs[6])
    nodes.link(colour.outputs[2], shader.inputs["Base Color"])
    rough = nodes.add("Mix", data_type="FLOAT")
    rough.inputs[3].default_value = 0.24
    nodes.link(moist, rough.inputs[0])
    nodes.link(nodes.texture(textures / "skin_roughness.png", True), rough.inputs[2])
    nodes.link(rough.outputs[0], shader.inputs["Roughness"])
    height = nodes.texture(textures / "skin_height.png", True)
    nodes.link(nodes.bump(height, 1.0, 1.0), shader.inputs["Normal"])
    shader.subsurface_method = "RANDOM_WALK_SKIN"
    shader.inputs["Subsurface Weight"].default_value = 1.0
    shader.inputs["Subsurface Radius"].default_value = (1.0, 0.36, 0.20)
    shader.inputs["Subsurface Scale"].default_value = 1.1
    shader.inputs["Subsurface Anisotropy"].default_value = 0.0
    return nodes.surface(shader)


def eye_material(settings: Settings) -> Any:
    """Iris, and a sclera that scatters and shines."""
    nodes = Nodes("eye")
    textures = Path(settings["textures"])
    shader = nodes.add("BsdfPrincipled", Roughness=0.5, Coat_Roughness=0.07, Coat_IOR=1.33)
    nodes.link(nodes.texture(textures / "eye_colour.png", False), shader.inputs["Base Color"])
    height = nodes.texture(textures / "eye_height.png", True)
    nodes.link(nodes.bump(height, 0.5, 0.6), shader.inputs["Normal"])
    nodes.link(nodes.bump(height, 0.5, 0.12), shader.inputs["Coat Normal"])
    shader.subsurface_method = "RANDOM_WALK"
    shader.inputs["Subsurface Radius"].default_value = (1.0, 0.7, 0.5)
    shader.inputs["Subsurface Scale"].default_value = 0.7
    # Coat and scattering on the sclera alone: the cornea in front already shines over the iris.
    sclera = nodes.attribute("sclera")
    for socket, factor in (("Coat Weight", 0.9), ("Subsurface Weight", 0.45), ("Specular IOR Level", 0.25)):
        nodes.link(nodes.scaled(sclera, factor), shader.inputs[socket])
    return nodes.surface(shader)


def cornea_material(_settings: Settings) -> Any:
    """Glass that lets shadow and diffuse rays through, so that the iris is lit without caustics."""
    nodes = Nodes("cornea")
    glass, clear = nodes.add("BsdfGlass", IOR=1.34, Roughness=0.0), nodes.add("BsdfTransparent")
    path, either, mix = nodes.add("LightPath"), nodes.add("Math", operation="MAXIMUM"), nodes.add("MixShader")
    nodes.link(path.outputs["Is Shadow Ray"], either.inputs[0])
    nodes.link(path.outputs["Is Diffuse Ray"], either.inputs[1])
    nodes.link(either.outputs[0], mix.inputs[0])
    nodes.link(glass.outputs[0], mix.inputs[1])
    nodes.link(clear.outputs[0], mix.inputs[2])
    return nodes.surface(mix)


def tear_material(_settings: Settings) -> Any:
    """Tears: a Fresnel shine over what lies behind."""
    nodes = Nodes("tear")
    gloss, clear = nodes.add("BsdfGlossy", Roughness=0.06), nodes.add("BsdfTransparent")
    fresnel, mix = nodes.add("Fresnel", IOR=1.34), nodes.add("MixShader")
    nodes.link(fresnel.outputs[0], mix.inputs[0])
    nodes.link(clear.outputs[0], mix.inputs[1])
    nodes.link(gloss.outputs[0], mix.inputs[2])
    return nodes.surface(mix)


def flesh_material(settings: Settings) -> Any:
    """Wet pink tissue of the corners."""
    nodes = Nodes("flesh")
    shader = nodes.add("BsdfPrincipled", Roughness=0.25, Coat_Weight=0.6, Coat_Roughness=0.12)
    shader.inputs["Base Color"].default_value = (*settings["flesh_colour"], 1)
    shader.inputs["Subsurface Weight"].default_value = 0.8
    shader.inputs["Subsurface Radius"].default_value = (1.0, 0.35, 0.25)
    shader.inputs["Subsurface Scale"].default_value = 0.8
    noise, place = nodes.add("TexNoise", Scale=1.3, Detail=3.0), nodes.add("TexCoord")
    nodes.link(place.outputs["Object"], noise.inputs["Vector"])
    nodes.link(nodes.bump(noise.outputs[0], 0.3, 0.7), shader.inputs["Normal"])
    return nodes.surface(shader)


def hair_material(name: str, colour: list[float], roughness: float) -> Any:
    """A hair shader of one colour."""
    nodes = Nodes(name)
    shader = nodes.add("BsdfHairPrincipled", parametrization="COLOR", Roughness=roughness)
    shader.inputs["Color"].default_value = (*colour, 1)
    shader.inputs["Radial Roughness"].default_value = 0.5
    return nodes.surface(shader)


def emission(name: str, strength: float) -> Any:
    """Unlit material of one brightness."""
    nodes = Nodes(name)
    return nodes.surface(nodes.add("Emission", Strength=strength))


def materials(kind: str, settings: Settings) -> dict[str, Any]:
    """Materials by name. An eye mask shows the eye white."""
    if kind == "beauty":
        made = {
            name: globals()[f"{name}_material"](settings)
            for name in ("skin", "eye", "cornea", "tear", "flesh")
        }
        made["lash"] = hair_material("lash", settings["lash_colour"], 0.25)
        made["brow"] = hair_material("brow", settings["brow_colour"], 0.34)
        return made
    black, white = emission("black", 0.0), emission("white", 1.0)
    return {"skin": black, "eye": white, "flesh": white}


def add_mesh(part: Settings, arrays: Arrays, material: Any) -> None:
    """Add a smooth mesh of quads with its UVs and per-vertex values."""
    mesh = bpy.data.meshes.new(part["name"])
    vertices, quads = arrays["vertices"], arrays["quads"]
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", vertices.ravel())
    mesh.loops.add(quads.size)
    mesh.loops.foreach_set("vertex_index", quads.ravel())
    mesh.polygons.add(len(quads))
    mesh.polygons.foreach_set("loop_start", np.arange(0, quads.size, 4, dtype=np.int32))
    if "uv" in arrays:
        layer = mesh.uv_layers.new(name="uv")
        layer.uv.foreach_set("vector", arrays["uv"][quads.ravel()].ravel())
    for name, values in arrays.items():
        if name.startswith("value_"):
            attribute = mesh.attributes.new(name.removeprefix("value_"), "FLOAT", "POINT")
            attribute.data.foreach_set("value", values)
    mesh.update(calc_edges=True)
    mesh.shade_smooth()
    mesh.materials.append(material)
    thing = bpy.data.objects.new(part["name"], mesh)
    thing.location = part["place"]
    thing.rotation_euler = (0, math.radians(part["turn"]), 0)
    bpy.context.scene.collection.objects.link(thing)


def add_hair(part: Settings, arrays: Arrays, material: Any) -> None:
    """Curves that taper to the tip."""
    points, radii = arrays["points"], arrays["radii"]
    count, length = points.shape[:2]
    curves = bpy.data.hair_curves.new(part["name"])
    curves.add_curves([length] * count)
    curves.attributes["position"].data.foreach_set("vector", points.ravel())
    taper = np.sqrt(np.clip(1 - np.linspace(0, 1, length) ** 2.2, 0.0, 1)) * 0.97 + 0.03
    radius = curves.attributes.get("radius") or curves.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", (radii[:, None] * taper).astype(np.float32).ravel())
    curves.materials.append(material)
    thing = bpy.data.objects.new(part["name"], curves)
    bpy.context.scene.collection.objects.link(thing)


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


def add_camera(settings: Settings) -> None:
    """Perspective camera on the z axis; the frame is `width_mm` wide in the plane of the pupils."""
    camera = bpy.data.cameras.new("camera")
    camera.sensor_width, camera.clip_start, camera.clip_end = 36.0, 10.0, 2000.0
    camera.lens = 36.0 * settings["distance_mm"] / settings["width_mm"]
    thing = bpy.data.objects.new("camera", camera)
    thing.location = (0, settings["centre_y_mm"], settings["plane_z_mm"] + settings["distance_mm"])
    bpy.context.scene.collection.objects.link(thing)
    bpy.context.scene.camera = thing


def configure(job: Settings, settings: Settings) -> None:
    """Cycles settings of a job; the sampling seed is the same at every level, so noise stands still."""
    scene = bpy.context.scene
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.use_persistent_data = True
    render.resolution_x, render.resolution_y = settings["size_px"]
    render.resolution_percentage = 100
    beauty = job["kind"] == "beauty"
    cycles.device = "CPU"
    cycles.samples, cycles.seed = job["samples"], settings["seed"]
    cycles.use_adaptive_sampling = beauty
    cycles.adaptive_threshold = job.get("threshold", 0.015)
    cycles.use_denoising = beauty
    if beauty:
        cycles.denoiser, cycles.denoising_prefilter = "OPENIMAGEDENOISE", "ACCURATE"
        cycles.denoising_input_passes = "RGB_ALBEDO_NORMAL"
    cycles.max_bounces = 8 if beauty else 0
    cycles.diffuse_bounces, cycles.glossy_bounces = 1, 3
    cycles.use_light_tree = False
    cycles.transmission_bounces, cycles.transparent_max_bounces = 6, 12
    cycles.caustics_reflective = cycles.caustics_refractive = False
    cycles.sample_clamp_indirect = 4
    scene.cycles_curves.shape = "RIBBONS"
    render.threads_mode, render.threads = "FIXED", settings["threads"]
    render.filter_size = 1.5
    scene.view_settings.view_transform = "Raw"
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"


def load_scene(job: Settings, settings: Settings) -> None:
    """Replace the scene with a job's."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with np.load(job["scene"]) as stored:
        parts = json.loads(bytes(stored["header"]).decode())
        made = materials(job["kind"], settings)
        for index, part in enumerate(parts):
            material = made.get(part["name"], made.get(part["material"]))
            if material is not None:
                arrays = {name: stored[f"{index}_{name}"] for name in part["fields"]}
                (add_mesh if part["kind"] == "mesh" else add_hair)(part, arrays, material)
    add_camera(settings)
    if job["kind"] == "beauty":
        add_lights(settings)


def render_crop(crop: list[int], settings: Settings, draft: Path) -> Any:
    """(height, width, 3) scene-linear float16 of one rectangle (x, y, width, height in px) of the frame."""
    x, y, width, height = crop
    full_width, full_height = settings["size_px"]
    render = bpy.context.scene.render
    render.use_border = render.use_crop_to_border = True
    render.border_min_x, render.border_max_x = x / full_width, (x + width) / full_width
    render.border_min_y, render.border_max_y = 1 - (y + height) / full_height, 1 - y / full_height
    render.filepath = str(draft)
    try:
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(str(draft))
        image.colorspace_settings.name = "Non-Color"
        pixels = np.empty(width * height * 4, np.float32)
        image.pixels.foreach_get(pixels)
        bpy.data.images.remove(image)
    finally:
        draft.unlink(missing_ok=True)
    return pixels.reshape(height, width, 4)[::-1, :, :3].astype(np.float16)


def render_job(job: Settings, settings: Settings) -> None:
    """Write every crop of a job to the .npz job["out"], whole or not at all."""
    load_scene(job, settings)
    configure(job, settings)
    out = Path(job["out"])
    draft = out.with_name(f".{out.name}.{os.getpid()}.exr")
    crops = {name: render_crop(crop, settings, draft) for name, crop in job["crops"].items()}
    part = draft.with_suffix(".npz")
    np.savez(part, **crops)
    part.replace(out)


def main() -> None:
    """Render jobs until stdin ends."""
    settings = json.loads(Path(sys.argv[1]).read_text())
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for line in sys.stdin:
        job, started = json.loads(line), time.monotonic()
        render_job(job, settings)
        answers.write(json.dumps({"out": job["out"], "seconds": time.monotonic() - started}) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
