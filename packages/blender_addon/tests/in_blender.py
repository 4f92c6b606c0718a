"""Runs inside Blender: installs the built add-on, uses every button, prints what became of the curves."""

import json
import sys
import time
import wave
import zipfile
from pathlib import Path

import bpy
import numpy as np

RESULTS = {}


def main(zip_path, folder):
    with zipfile.ZipFile(zip_path) as archive:
        archive.extractall(folder / "palpebra_blinks")
    sys.path.insert(0, str(folder))
    import palpebra_blinks

    palpebra_blinks.register()
    face = bpy.data.objects["Cube"]
    for name in ("Basis", "eyeBlinkLeft", "eyeBlinkRight", "jawOpen"):
        face.shape_key_add(name=name)
    bpy.context.view_layer.objects.active = face
    scene = bpy.context.scene
    scene.render.fps, scene.frame_start, scene.frame_end = 60, 1, 36000
    RESULTS["guess"] = called(bpy.ops.palpebra.guess)
    RESULTS["names"] = [face.palpebra.left, face.palpebra.right]
    filling(face, scene)
    own_keys(face, scene)
    rerolling(face, scene)
    few(face, scene)
    locked(face)
    speech(face, scene, folder)
    bones(scene)
    other_rigs(face)
    flagged(face, scene)
    half_locked(face, scene)
    RESULTS["removed"] = removing(face)
    RESULTS["undone"] = undoing(face.name, scene)
    palpebra_blinks.unregister()
    sys.stdout.write(f"RESULT {json.dumps(RESULTS)}\n")


def called(operator):
    """Outcome of an operator; Blender raises what it reports as an error."""
    try:
        return list(operator())
    except RuntimeError as error:
        return str(error).strip()


def curve(block, name):
    from palpebra_blinks.channels import _curves

    path = f'key_blocks["{name}"].value'
    return next(c for c in _curves(block.animation_data) if c.data_path == path)


def points(keys):
    return [(p.co[0], p.co[1], p.type) for p in curve(keys, "eyeBlinkLeft").keyframe_points]


def filling(face, scene):
    face.palpebra.seed, face.palpebra.state = 4, "listening"
    begun = time.process_time()
    RESULTS["fill"] = called(bpy.ops.palpebra.fill)
    RESULTS["fill_s"] = time.process_time() - begun
    keys = face.data.shape_keys
    left = curve(keys, "eyeBlinkLeft")
    frames = np.arange(1, 36001)
    RESULTS["left"] = [round(left.evaluate(int(frame)), 6) for frame in frames[:6000]]
    RESULTS["keys"] = len(left.keyframe_points)
    RESULTS["baseline_s"] = plain_keys_s(500)


def plain_keys_s(count):
    """Processor time of so many keys on two channels, put in one by one as scripts do."""
    bpy.ops.object.empty_add()
    empty = bpy.context.object
    begun = time.process_time()
    for index in (0, 1):
        for frame in range(count):
            empty.location[index] = frame % 7
            empty.keyframe_insert("location", index=index, frame=frame)
    taken = time.process_time() - begun
    bpy.data.objects.remove(empty)
    bpy.context.view_layer.objects.active = bpy.data.objects["Cube"]
    return taken


def own_keys(face, scene):
    keys = face.data.shape_keys
    keys.key_blocks["eyeBlinkLeft"].value = 0.5
    keys.key_blocks["eyeBlinkLeft"].keyframe_insert("value", frame=40000)
    before = points(keys)
    scene.frame_end = 41000
    RESULTS["own"] = called(bpy.ops.palpebra.fill)
    RESULTS["untouched"] = before == [
        (p.co[0], p.co[1], p.type) for p in curve(keys, "eyeBlinkLeft").keyframe_points
    ]
    scene.frame_end = 36000
    RESULTS["own_outside"] = called(bpy.ops.palpebra.fill)
    RESULTS["own_kept"] = abs(curve(keys, "eyeBlinkLeft").evaluate(40000) - 0.5) < 1e-6


def rerolling(face, scene):
    left = curve(face.data.shape_keys, "eyeBlinkLeft")
    shut = [round(p.co[0]) for p in left.keyframe_points if p.co[1] > 0.5]
    before = {round(p.co[0]): p.co[1] for p in left.keyframe_points}
    scene.frame_set(shut[len(shut) // 2])
    RESULTS["reroll"] = called(bpy.ops.palpebra.reroll)
    left = curve(face.data.shape_keys, "eyeBlinkLeft")
    after = {round(p.co[0]): p.co[1] for p in left.keyframe_points}
    changed = sorted(f for f in before.keys() | after.keys() if before.get(f) != after.get(f))
    RESULTS["changed"] = [changed[0], changed[-1]] if changed else []
    scene.frame_set(39000)
    RESULTS["reroll_nothing"] = called(bpy.ops.palpebra.reroll)


def few(face, scene):
    face.palpebra.density = "FEW"
    bpy.ops.palpebra.fill()
    RESULTS["few"] = len(curve(face.data.shape_keys, "eyeBlinkLeft").keyframe_points)
    face.palpebra.density = "EVERY_FRAME"


def flagged(face, scene):
    """The flag keyed from frame 200 to 500, then on without keys."""
    bpy.context.view_layer.objects.active = face
    scene.frame_end, face.palpebra.state = 1200, "speaking"
    for frame, up in ((1, False), (200, True), (501, False)):
        face.palpebra.hold = up
        face.palpebra.keyframe_insert("hold", frame=frame)
    RESULTS["flag"] = called(bpy.ops.palpebra.fill)
    left = curve(face.data.shape_keys, "eyeBlinkLeft")
    RESULTS["flagged"] = [round(left.evaluate(frame), 6) for frame in range(1, 1201)]
    face.palpebra.keyframe_delete("hold", frame=1)
    face.palpebra.keyframe_delete("hold", frame=200)
    face.palpebra.keyframe_delete("hold", frame=501)
    face.palpebra.hold = True
    RESULTS["flag_on"] = called(bpy.ops.palpebra.fill)
    face.palpebra.hold, face.palpebra.state = False, "listening"


def locked(face):
    block = face.data.shape_keys.key_blocks["eyeBlinkLeft"]
    block.lock_shape = True
    RESULTS["locked"] = called(bpy.ops.palpebra.fill)
    block.lock_shape = False
    block.driver_add("value")
    RESULTS["driven"] = called(bpy.ops.palpebra.fill)
    block.driver_remove("value")
    face.palpebra.left = "eyeBlnkLeft"
    RESULTS["mistyped"] = called(bpy.ops.palpebra.blink)
    face.palpebra.left = "eyeBlinkLeft"


def speech(face, scene, folder):
    scene.frame_end = 1200
    rng = np.random.default_rng(1)
    loud = np.repeat([0, 1, 0, 1, 0, 1, 0, 0, 0, 1], 16000) * rng.normal(0, 0.2, 160000)
    samples = np.clip(loud + rng.normal(0, 0.001, 160000), -1, 1)
    for name, data in (("voice.wav", samples), ("silence.wav", np.zeros(16000))):
        with wave.open(str(folder / name), "wb") as sound:
            sound.setnchannels(1)
            sound.setsampwidth(2)
            sound.setframerate(16000)
            sound.writeframes((data * 32767).astype("<i2").tobytes())
    face.palpebra.sound = str(folder / "voice.wav")
    RESULTS["speech"] = called(bpy.ops.palpebra.from_speech)
    face.palpebra.sound = str(folder / "silence.wav")
    RESULTS["silence"] = called(bpy.ops.palpebra.from_speech)
    face.palpebra.sound = str(folder / "nothing.wav")
    RESULTS["no_file"] = called(bpy.ops.palpebra.from_speech)
    (folder / "text.wav").write_text("no sound")
    face.palpebra.sound = str(folder / "text.wav")
    RESULTS["no_sound"] = called(bpy.ops.palpebra.from_speech)


def bones(scene):
    bpy.ops.object.armature_add(enter_editmode=True)
    rig = bpy.context.object
    for name in ("lid.T.L.002", "lid.T.R.002", "lid.B.L.002"):
        bone = rig.data.edit_bones.new(name)
        bone.head, bone.tail = (0, 0, 0), (0, 0, 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    RESULTS["bone_guess"] = called(bpy.ops.palpebra.guess)
    RESULTS["bone_names"] = [rig.palpebra.left, rig.palpebra.right]
    rig.palpebra.bone_motion, rig.palpebra.bone_axis = "LOCATION", "Z"
    RESULTS["bone_no_way"] = called(bpy.ops.palpebra.fill)
    rig.palpebra.bone_closed_m = -0.01
    scene.frame_end = 1200
    RESULTS["bone_fill"] = called(bpy.ops.palpebra.fill)
    scene.frame_set(1)
    values = []
    for frame in range(1, 1201):
        scene.frame_set(frame)
        values.append(round(rig.pose.bones["lid.T.L.002"].location[2], 7))
    RESULTS["bone_values"] = values
    rig.palpebra.bone_motion = "ROTATION"
    RESULTS["quaternion"] = called(bpy.ops.palpebra.fill)


def other_rigs(face):
    bpy.ops.mesh.primitive_cube_add()
    bare = bpy.context.object
    RESULTS["no_lids"] = called(bpy.ops.palpebra.guess)
    RESULTS["no_shapes"] = called(bpy.ops.palpebra.fill)
    RESULTS["nothing_written"] = bare.animation_data is None and bare.data.shape_keys is None
    for name in ("Basis", "MyEyesClose_L", "MyEyesClose_R", "winkR", "winkL"):
        bare.shape_key_add(name=name)
    RESULTS["unknown_scheme"] = called(bpy.ops.palpebra.guess)
    RESULTS["table"] = [[row.title, row.left, row.right] for row in bare.palpebra.guesses]


def removing(face):
    bpy.context.view_layer.objects.active = face
    bpy.ops.palpebra.clear()
    return [(p.co[0], round(p.co[1], 3)) for p in curve(face.data.shape_keys, "eyeBlinkLeft").keyframe_points]


def half_locked(face, scene):
    """One channel can be written, the other not: neither is."""
    keys = face.data.shape_keys
    bpy.context.view_layer.objects.active = face
    scene.frame_end = 1200
    right, animation = curve(keys, "eyeBlinkRight"), keys.animation_data
    bag = animation.action.layers[0].strips[0].channelbag(animation.action_slot)
    right.group = bag.groups.new("eyes")
    for name, switch in (("locked_curve", right), ("locked_group", right.group)):
        before, switch.lock = points(keys), True
        face.palpebra.seed += 1
        RESULTS[name] = [called(bpy.ops.palpebra.fill), before == points(keys)]
        switch.lock = False


def everything(name):
    """All keys of an object's eyes and the settings that the buttons change, fetched again."""
    face = bpy.data.objects[name]
    keys = face.data.shape_keys
    made = [
        [[*p.co, *p.handle_left, *p.handle_right, p.type, p.interpolation] for p in one.keyframe_points]
        for one in (curve(keys, "eyeBlinkLeft"), curve(keys, "eyeBlinkRight"))
    ]
    return [made, face.palpebra.seed, face.palpebra.left, face.palpebra.right]


def undoing(name, scene):
    """Each button and one undo: is all as before? Undo makes every reference stale, so names are used."""
    face = bpy.data.objects[name]
    bpy.context.view_layer.objects.active = face
    face.palpebra.sound, face.palpebra.replace = str(Path(sys.argv[2]) / "voice.wav"), True
    for frame, value in ((300, 0.4), (340, 0.1)):
        face.data.shape_keys.key_blocks["eyeBlinkLeft"].value = value
        face.data.shape_keys.key_blocks["eyeBlinkLeft"].keyframe_insert("value", frame=frame)
    kept, filled = everything(name), None
    outcome = {}
    for button in ("fill", "blink", "from_speech", "guess", "reroll", "clear"):
        if button == "reroll":
            bpy.ops.palpebra.fill()
            filled = everything(name)
            scene = bpy.context.scene
            shut = [round(key[0]) for key in filled[0][0] if key[1] > 0.5 and key[6] == "GENERATED"]
            scene.frame_set(shut[0])
        before = filled if filled is not None else kept
        bpy.ops.ed.undo_push(message="before")
        done = list(getattr(bpy.ops.palpebra, button)("EXEC_DEFAULT", True))
        changed = everything(name) != before
        bpy.ops.ed.undo()
        outcome[button] = [done, changed, everything(name) == before]
    return outcome


main(Path(sys.argv[1]), Path(sys.argv[2]))
