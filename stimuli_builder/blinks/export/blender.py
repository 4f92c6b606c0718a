"""Curves as a Python script for Blender that sets f-curves on shape keys."""

import json

from stimuli_builder.blinks.export.curve import AnimationCurve

_SCRIPT = '''"""Blinks by Palpebra: keys the shape keys {left} and {right} of an object.

Run it in Blender's text editor with a mesh selected, or: blender FILE.blend --python THIS.py
A missing shape key is added (flat: sculpt the closed eye into it).
"""

import bpy

OBJECT = {object}
FPS = {fps}
START_FRAME = 1
CURVES = {curves}


def target():
    found = bpy.data.objects.get(OBJECT) if OBJECT else bpy.context.view_layer.objects.active
    if found is None or found.type != "MESH":
        raise SystemExit("Palpebra: select a mesh, or set OBJECT to the name of one")
    return found


def shape_key(mesh, name):
    if mesh.data.shape_keys is None:
        mesh.shape_key_add(name="Basis", from_mix=False)
    keys = mesh.data.shape_keys.key_blocks
    return keys[name] if name in keys else mesh.shape_key_add(name=name, from_mix=False)


def f_curves(animation):
    action = animation.action
    if hasattr(action, "fcurves"):
        return list(action.fcurves)
    bags = [bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags]
    return [curve for bag in bags for curve in bag.fcurves]


def main():
    mesh = target()
    scene = bpy.context.scene
    scene.render.fps = max(1, round(FPS))
    scene.render.fps_base = scene.render.fps / FPS
    for name, values in CURVES.items():
        key = shape_key(mesh, name)
        for frame, value in enumerate(values):
            key.value = value
            key.keyframe_insert("value", frame=START_FRAME + frame)
    paths = {{f'key_blocks["{{name}}"].value' for name in CURVES}}
    for curve in f_curves(mesh.data.shape_keys.animation_data):
        if curve.data_path in paths:
            for point in curve.keyframe_points:
                point.interpolation = "LINEAR"
    last = START_FRAME + max(len(values) for values in CURVES.values()) - 1
    scene.frame_end = max(scene.frame_end, last)


main()
'''


def to_blender(
    curve: AnimationCurve, mesh: str = "", left: str = "eyeBlinkLeft", right: str = "eyeBlinkRight"
) -> str:
    """Return the script; `mesh` names the object, the selected one without it."""
    return _SCRIPT.format(
        object=repr(mesh),
        fps=repr(curve.fps),
        left=left,
        right=right,
        curves=json.dumps({left: curve.left.tolist(), right: curve.right.tolist()}),
    )
