"""Meshes and hair from plain arrays. Runs in Blender's own Python: see cycles_worker.py."""

import math
from typing import Any

import bpy
import numpy as np

Part = dict[str, Any]
Arrays = dict[str, Any]


def add_mesh(part: Part, arrays: Arrays, material: Any) -> None:
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


def add_hair(part: Part, arrays: Arrays, material: Any) -> None:
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
