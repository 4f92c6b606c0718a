"""Render poses of one face with Cycles: runs under bpy in a separate environment and does not import
Palpebra.

Usage: python cycles_face_worker.py SETTINGS.json (what renderer.py writes). The scene is built once; jobs
arrive as JSON lines on stdin:
{"pose": FILE.npz, "out": FILE.npz, "samples": {NAME: N, ...}, "boxes": {NAME: [x, y, width, height], ...}}.
Each is answered by one JSON line on stdout, {"out": FILE, "seconds": S} or {"error": TEXT}; the first line
answers the start: {"device": NAME} or {"error": TEXT}. Blender's own chatter goes to stderr.
"""

import json
import os
import sys
import time
from pathlib import Path
from typing import Any

import bpy
import numpy as np

# Siblings, found in this script's own folder.
from cycles_face_layers import FACE, HAIR, HAIR_NOISE, Layers, collection
from cycles_face_materials import materials
from mathutils import Vector

GPU_KINDS = ("OPTIX", "CUDA", "HIP", "METAL", "ONEAPI")
Things = list[tuple[dict[str, Any], Any]]


def use_device(device_name: str) -> str:
    """Choose a GPU if there is one ('auto', or 'gpu', which must have one), else the CPU; its name."""
    scene = bpy.context.scene
    scene.cycles.device = "CPU"
    if device_name == "cpu":
        return "CPU"
    addon = bpy.context.preferences.addons.get("cycles")
    for kind in GPU_KINDS if addon is not None else ():
        try:
            addon.preferences.compute_device_type = kind
        except TypeError:
            continue
        addon.preferences.get_devices()
        devices = [device for device in addon.preferences.devices if device.type == kind]
        if devices:
            for device in addon.preferences.devices:
                device.use = device.type == kind
            scene.cycles.device = "GPU"
            return f"{kind} {devices[0].name}"
    if device_name == "gpu":
        raise RuntimeError("no GPU that Cycles can use")
    return "CPU"


def add_part(part: dict[str, Any], arrays: dict[str, Any], material: Any) -> Any:
    """Add a mesh or hair; returns its data block."""
    data = add_hair(part, arrays) if part["kind"] == "hair" else add_mesh(part, arrays)
    data.materials.append(material)
    layer = collection(HAIR if part["kind"] == "hair" else FACE)
    layer.objects.link(bpy.data.objects.new(part["name"], data))
    return data


def add_mesh(part: dict[str, Any], arrays: dict[str, Any]) -> Any:
    """A smooth mesh of quads with UVs and per-vertex values."""
    mesh = bpy.data.meshes.new(part["name"])
    vertices, quads = arrays["vertices"], arrays["quads"]
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", vertices.ravel())
    mesh.loops.add(quads.size)
    mesh.loops.foreach_set("vertex_index", quads.ravel())
    mesh.polygons.add(len(quads))
    mesh.polygons.foreach_set("loop_start", np.arange(0, quads.size, 4, dtype=np.int32))
    if "uv" in arrays:
        mesh.uv_layers.new(name="uv").uv.foreach_set("vector", arrays["uv"][quads.ravel()].ravel())
    for name, value in arrays.items():
        if name.startswith("value_"):
            kind, slot = ("FLOAT_VECTOR", "vector") if value.ndim == 2 else ("FLOAT", "value")
            attribute = mesh.attributes.new(name.removeprefix("value_"), kind, "POINT")
            attribute.data.foreach_set(slot, value.ravel())
    mesh.update(calc_edges=True)
    mesh.shade_smooth()
    return mesh


def add_hair(part: dict[str, Any], arrays: dict[str, Any]) -> Any:
    """Curves that taper to the tip."""
    count, length = arrays["points"].shape[:2]
    curves = bpy.data.hair_curves.new(part["name"])
    curves.add_curves([length] * count)
    curves.attributes["position"].data.foreach_set("vector", arrays["points"].ravel())
    taper = np.clip(1 - np.linspace(0, 1, length) ** 1.8, 0, 1) * 0.94 + 0.06
    radius = curves.attributes.get("radius") or curves.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", (arrays["radii"][:, None] * taper).astype(np.float32).ravel())
    return curves


def build(settings: dict[str, Any]) -> Things:
    """Fill the scene; parts with their data blocks in the file's order."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    made = materials(settings)
    things = []
    with np.load(settings["scene"]) as stored:
        for k, part in enumerate(json.loads(bytes(stored["header"]).decode())):
            arrays = {name: stored[f"{k}_{name}"] for name in part["fields"]}
            things.append((part, add_part(part, arrays, made[part["material"]])))
    add_camera(settings)
    add_lights(settings)
    configure(settings)
    return things


def pose(things: Things, file: str) -> None:
    """Move every part to a pose's positions."""
    with np.load(file) as stored:
        for k, (part, data) in enumerate(things):
            if part["kind"] == "hair":
                data.attributes["position"].data.foreach_set("vector", stored[f"{k}_points"].ravel())
                data.update_tag()
                continue
            data.vertices.foreach_set("co", stored[f"{k}_vertices"].ravel())
            values = f"{k}_value_"
            for name in (name for name in stored.files if name.startswith(values)):
                data.attributes[name.removeprefix(values)].data.foreach_set("value", stored[name])
            data.update()


def add_camera(settings: dict[str, Any]) -> None:
    """Perspective camera on the middle line that shows `width_cm` at `plane_z_cm`."""
    camera = bpy.data.cameras.new("camera")
    camera.sensor_fit, camera.sensor_width = "HORIZONTAL", 36.0
    camera.lens = 36.0 * settings["distance_cm"] / settings["width_cm"]
    thing = bpy.data.objects.new("camera", camera)
    thing.location = (0, settings["centre_y_cm"], settings["plane_z_cm"] + settings["distance_cm"])
    bpy.context.scene.collection.objects.link(thing)
    bpy.context.scene.camera = thing


def add_lights(settings: dict[str, Any]) -> None:
    """The preset's soft boxes and the room's faint light."""
    for light in settings["lights"]["areas"]:
        lamp = bpy.data.lights.new("area", "AREA")
        lamp.shape, lamp.size, lamp.size_y = "RECTANGLE", light["size"][0], light["size"][1]
        lamp.energy, lamp.color = light["energy"], light["colour"]
        thing = bpy.data.objects.new("area", lamp)
        thing.location = light["place"]
        thing.visible_glossy = thing.visible_transmission = light["mirrored"]
        towards = Vector(light["aim"]) - Vector(light["place"])
        thing.rotation_euler = towards.to_track_quat("-Z", "Y").to_euler()
        bpy.context.scene.collection.objects.link(thing)
    world = bpy.data.worlds.new("room")
    world.use_nodes = True
    background = world.node_tree.nodes["Background"]
    background.inputs[0].default_value = (*settings["lights"]["room"], 1)
    background.inputs[1].default_value = settings["lights"]["room_strength"]
    bpy.context.scene.world = world


def configure(settings: dict[str, Any]) -> None:
    """Cycles settings; the sampling seed is the same at every level, so that noise stands still."""
    scene = bpy.context.scene
    render, cycles = scene.render, scene.cycles
    render.engine, render.use_persistent_data = "CYCLES", True
    render.resolution_x, render.resolution_y = settings["size_px"]
    render.resolution_percentage = 100
    render.threads_mode, render.threads = "FIXED", settings["threads"]
    render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    render.film_transparent = True
    scene.view_settings.view_transform = "Raw"
    scene.cycles_curves.shape = "RIBBONS"
    cycles.seed, cycles.use_denoising = settings["seed"], False
    cycles.use_adaptive_sampling, cycles.adaptive_threshold = True, HAIR_NOISE
    cycles.max_bounces, cycles.diffuse_bounces, cycles.glossy_bounces = 8, 1, 2
    cycles.use_light_tree = False
    cycles.transmission_bounces, cycles.transparent_max_bounces = 5, 12
    cycles.sample_clamp_indirect = 4.0
    cycles.caustics_reflective = cycles.caustics_refractive = False
    cycles.filter_width = 1.3


def frame_box(box: list[int], size: list[int]) -> None:
    """Render one rectangle (x, y, width, height in px) of the frame from now on."""
    x, y, width, height = box
    render = bpy.context.scene.render
    render.use_border = render.use_crop_to_border = True
    # Cycles truncates a share of the frame to whole pixels: a quarter of one guards against rounding down.
    low = size[1] - y - height
    render.border_min_x, render.border_max_x = (x + 0.25) / size[0], (x + width + 0.25) / size[0]
    render.border_min_y, render.border_max_y = (low + 0.25) / size[1], (low + height + 0.25) / size[1]


def render_job(job: dict[str, Any], settings: dict[str, Any], things: Things, layers: Layers) -> None:
    """Write every box of a job, (height, width, 3) scene-linear float16, to the .npz job["out"], or none."""
    pose(things, job["pose"])
    out = Path(job["out"])
    draft = out.with_name(f".{out.name}.{os.getpid()}.exr")
    boxes = {}
    for name, box in job["boxes"].items():
        frame_box(box, settings["size_px"])
        boxes[name] = layers.picture(draft, job["samples"][name]).astype(np.float16)
    part = draft.with_suffix(".npz")
    try:
        np.savez(part, **boxes)
        part.replace(out)
    finally:
        part.unlink(missing_ok=True)


def main() -> None:
    """Build the scene, then render jobs until stdin ends."""
    settings = json.loads(Path(sys.argv[1]).read_text())
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)

    def answer(content: dict[str, Any]) -> None:
        answers.write(json.dumps(content) + "\n")
        answers.flush()

    try:
        things = build(settings)
        layers = Layers(settings)
        answer({"device": use_device(settings["device"])})
        for line in sys.stdin:
            job, started = json.loads(line), time.monotonic()
            render_job(job, settings, things, layers)
            answer({"out": job["out"], "seconds": time.monotonic() - started})
    except (RuntimeError, OSError) as error:
        answer({"error": (str(error).strip().splitlines() or ["no message"])[-1]})


if __name__ == "__main__":
    main()
