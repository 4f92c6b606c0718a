"""Render scene files with Cycles: runs under bpy in an environment of its own and imports no Palpebra.

Usage: python cycles_worker.py SETTINGS.json (what renderer.py writes). Jobs arrive as JSON lines on stdin:
{"scene": FILE, "out": FILE.npz, "kind": "beauty"|"eye_mask", "samples": N,
"crops": {NAME: [x, y, width, height], ...}}. Each is answered by one JSON line on stdout:
{"out": FILE, "seconds": S}. Blender's own chatter goes to stderr.
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
from cycles_geometry import add_hair, add_mesh
from cycles_lights import add_lights
from cycles_materials import materials

Settings = dict[str, Any]


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
