"""Animation curves for other programs: the curve, and every format it can be written in."""

import base64
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from zlib import crc32

import numpy as np

from experiments.errors import InputError, nearest
from stimuli_builder.blinks.profile import Array, BlinkProfile

# How the lower eyelid moves in a blink: as a track measured it, else from physiology.

VERTICAL_RANGE_MM = (0.5, 1.0)
HORIZONTAL_RANGE_MM = (1.4, 5.0)


def lower_lid(profile: BlinkProfile, closure: Array | None = None) -> tuple[Array, Array]:
    """Vertical and horizontal displacement of the lower lid during a blink, in mm.

    Measured where a track gave it. Else from physiology: a blink slides the lower lid 1.4-5 mm toward the
    nose and lifts it 0.5-1 mm, together with the upper lid (Doane 1980, Am J Ophthalmol 89:507, describes the
    motion). The peaks for a complete blink are drawn from these ranges, the horizontal one evenly on a log
    scale, by the profile's name: the same profile always moves alike. Both follow the closure; the nasal
    slide lags it by some 10 ms, and nothing moves while the eye is open.

    Parameters
    ----------
    closure : (n,) array, optional
        The profile's closure with the open eye before and after it, in which the lagging slide comes to rest;
        without it the profile's own samples, at whose end the slide is still on its way. Not for a measured
        lower lid.

    Returns
    -------
    vertical_mm, horizontal_mm : (n,) float64 arrays
        Upwards and toward the nose positive, 0 with the eye open, at the profile's rate.
    """
    if profile.lower_up_mm is not None and profile.lower_nasal_mm is not None:
        return profile.lower_up_mm, profile.lower_nasal_mm
    rng = np.random.default_rng(crc32(profile.profile_id.encode()))
    vertical_peak_mm = rng.uniform(*VERTICAL_RANGE_MM)
    horizontal_peak_mm = float(np.exp(rng.uniform(*np.log(HORIZONTAL_RANGE_MM))))
    shown = profile.closure if closure is None else closure
    return vertical_peak_mm * shown, horizontal_peak_mm * _lagged(shown, profile.fps)


def _lagged(closure: Array, fps: int, time_constant_ms: float = 10.0) -> Array:
    """First-order lag of the closure, starting from its first sample; never above the closure's peak."""
    share = 1.0 - np.exp(-1000.0 / (fps * time_constant_ms))
    lagged = np.empty_like(closure)
    level = float(closure[0])
    for index, value in enumerate(closure):
        level += share * (float(value) - level)
        lagged[index] = level
    return lagged


# The curve that is exported: closure of both eyes at the frame rate of the animation.

INTERVAL_MEDIAN_S = 3.4
INTERVAL_LOG_SD = 0.87
REST_S = 0.1
"""Open eye after a blink in which its lagging signals come to rest."""


@dataclass(frozen=True, eq=False)
class AnimationCurve:
    """Closure of the left and right eye at `fps`, and the lower lids' motion in mm.

    `blinks` names each blink with the frame of its onset. `gaze_deg` (n, 2) is the direction of gaze to the
    person's right and up, in degrees; None where nobody gave one.
    """

    fps: float
    left: Array
    right: Array
    lower_up_mm: Array
    lower_nasal_mm: Array
    blinks: tuple[tuple[str, float], ...]
    gaze_deg: Array | None = None


def make_curve(
    profiles: Sequence[BlinkProfile], fps: float, lead_s: float = 0.0, seed: int | None = None
) -> AnimationCurve:
    """Put blinks one after another on a curve at `fps`.

    Each blink is laid so that its minimum falls on a frame: else an animation at 30 fps would miss the
    moment of closure. The first begins after `lead_s`; the following ones at natural intervals from
    minimum to minimum, drawn log-normal (median 3.4 s, sd of log 0.87) from `seed`.

    Parameters
    ----------
    profiles : sequence of BlinkProfile
    fps : float
        Frame rate of the curve, 1 to 1000.
    lead_s : float
        Open-eye seconds before the first and after the last blink.
    seed : int, optional
        For the intervals; needed with two or more blinks.
    """
    if not 1 <= fps <= 1000:
        raise InputError(f"the frame rate of a curve must be between 1 and 1000, got {fps:g}")
    if not 0 <= lead_s <= 3600:
        raise InputError(f"the lead must be between 0 and 3600 seconds, got {lead_s:g}")
    if not profiles:
        raise InputError("a curve needs one blink or more")
    minima = _minimum_frames(profiles, fps, lead_s, np.random.default_rng(seed))
    last = profiles[-1]
    tail = (last.closure.size - 1 - last.minimum_index) / last.fps + lead_s
    frames = np.arange(minima[-1] + int(np.ceil(tail * fps - 1e-9)) + 1)
    tracks = np.zeros((4, frames.size))
    for profile, minimum in zip(profiles, minima, strict=True):
        # The nasal slide lags the lids: it comes to rest after the blink's last sample.
        up, nasal = lower_lid(profile, _with_rest(profile))
        other = profile.closure if profile.closure_other is None else profile.closure_other
        position = (frames - minimum) * profile.fps / fps + profile.minimum_index
        for track, values in zip(tracks, (profile.closure, other, up, nasal), strict=True):
            # Blinks drawn closer than they last meet at the more closed of the two.
            np.maximum(track, np.interp(position, np.arange(values.size), values, left=0, right=0), out=track)
    onsets = [minimum - p.down_frames / p.fps * fps for p, minimum in zip(profiles, minima, strict=True)]
    names = tuple((p.profile_id, round(onset, 4)) for p, onset in zip(profiles, onsets, strict=True))
    left, right, up, nasal = np.round(tracks, 6)
    return AnimationCurve(fps, left, right, up, nasal, names)


def _with_rest(profile: BlinkProfile) -> Array | None:
    """The closure and the open eye after it; None where the lower lid was measured with the blink."""
    if profile.lower_up_mm is not None:
        return None
    return np.pad(profile.closure, (0, round(REST_S * profile.fps)), mode="edge")


def _minimum_frames(
    profiles: Sequence[BlinkProfile], fps: float, lead_s: float, rng: np.random.Generator
) -> list[int]:
    first = profiles[0]
    frames = [int(np.ceil((lead_s + first.minimum_index / first.fps) * fps - 1e-9))]
    for previous, profile in pairwise(profiles):
        drawn_s = float(rng.lognormal(np.log(INTERVAL_MEDIAN_S), INTERVAL_LOG_SD))
        least_s = (previous.closure.size - previous.minimum_index + profile.minimum_index) / profile.fps
        frames.append(frames[-1] + int(np.ceil(max(drawn_s, least_s) * fps)))
    return frames


# Curves as CSV and JSON.

CSV_COLUMNS = {
    "frame": "frame from 0",
    "time_s": "seconds from the first frame",
    "closure_left": "closure of the left eye, 0 open to 1 closed",
    "closure_right": "closure of the right eye",
    "lower_up_mm": "lift of the lower lids in mm",
    "lower_nasal_mm": "slide of the lower lids toward the nose in mm",
}
GAZE_COLUMNS = {
    "gaze_right_deg": "gaze to the person's right in degrees",
    "gaze_up_deg": "gaze upward in degrees",
}


def to_csv(curve: AnimationCurve) -> str:
    """One row per frame, columns as in `CSV_COLUMNS`, then the gaze if there is one."""
    lids = [curve.left, curve.right, curve.lower_up_mm, curve.lower_nasal_mm]
    gaze = () if curve.gaze_deg is None else curve.gaze_deg.T
    rows = [
        f"{frame},{frame / curve.fps:.6f}," + ",".join(f"{value:g}" for value in values)
        for frame, values in enumerate(zip(*lids, *gaze, strict=True))
    ]
    columns = [*CSV_COLUMNS, *(() if curve.gaze_deg is None else GAZE_COLUMNS)]
    return "\n".join([",".join(columns), *rows]) + "\n"


def to_json(curve: AnimationCurve) -> str:
    """The arrays of the CSV with the rate and each blink's name and onset frame."""
    content = {
        "format": "palpebra-blink-curve-1",
        "fps": curve.fps,
        "blinks": [{"profile_id": name, "onset_frame": onset} for name, onset in curve.blinks],
        "closure_left": curve.left.tolist(),
        "closure_right": curve.right.tolist(),
        "lower_up_mm": curve.lower_up_mm.tolist(),
        "lower_nasal_mm": curve.lower_nasal_mm.tolist(),
    }
    if curve.gaze_deg is not None:
        content |= dict(zip(GAZE_COLUMNS, curve.gaze_deg.T.tolist(), strict=True))
    return json.dumps(content, indent=1) + "\n"


# Curves as an ARKit blend-shape CSV, the layout the Live Link Face app records.

# fmt: off
BLEND_SHAPES = (
    "EyeBlinkLeft", "EyeLookDownLeft", "EyeLookInLeft", "EyeLookOutLeft", "EyeLookUpLeft", "EyeSquintLeft",
    "EyeWideLeft", "EyeBlinkRight", "EyeLookDownRight", "EyeLookInRight", "EyeLookOutRight", "EyeLookUpRight",
    "EyeSquintRight", "EyeWideRight", "JawForward", "JawRight", "JawLeft", "JawOpen", "MouthClose",
    "MouthFunnel", "MouthPucker", "MouthRight", "MouthLeft", "MouthSmileLeft", "MouthSmileRight",
    "MouthFrownLeft", "MouthFrownRight", "MouthDimpleLeft", "MouthDimpleRight", "MouthStretchLeft",
    "MouthStretchRight", "MouthRollLower", "MouthRollUpper", "MouthShrugLower", "MouthShrugUpper",
    "MouthPressLeft", "MouthPressRight", "MouthLowerDownLeft", "MouthLowerDownRight", "MouthUpperUpLeft",
    "MouthUpperUpRight", "BrowDownLeft", "BrowDownRight", "BrowInnerUp", "BrowOuterUpLeft",
    "BrowOuterUpRight", "CheekPuff", "CheekSquintLeft", "CheekSquintRight", "NoseSneerLeft",
    "NoseSneerRight", "TongueOut", "HeadYaw", "HeadPitch", "HeadRoll", "LeftEyeYaw", "LeftEyePitch",
    "LeftEyeRoll", "RightEyeYaw", "RightEyePitch", "RightEyeRoll",
)
# fmt: on


def to_arkit(curve: AnimationCurve) -> str:
    """EyeBlink* carry the closures, EyeLook* the gaze, other shapes stay 0; time is HH:MM:SS:FF.mmm."""
    tracks = {"EyeBlinkLeft": curve.left, "EyeBlinkRight": curve.right} | _eye_looks(curve.gaze_deg)
    moved = {BLEND_SHAPES.index(name): track for name, track in tracks.items()}
    lines = [",".join(["Timecode", "BlendShapeCount", *BLEND_SHAPES])]
    for frame in range(curve.left.size):
        values = ["0"] * len(BLEND_SHAPES)
        for index, track in moved.items():
            values[index] = f"{track[frame]:.6f}"
        lines.append(",".join([timecode(frame, curve.fps), str(len(BLEND_SHAPES)), *values]))
    return "\n".join(lines) + "\n"


FULL_LOOK_DEG = 35.0
"""Gaze at which an ARKit shape of the eyes is 1: about as far as eyes turn without the head."""


def _eye_looks(gaze_deg: Array | None) -> dict[str, Array]:
    """Shapes of both eyes' gaze: to the person's right is out for the right eye, and in for the left."""
    if gaze_deg is None:
        return {}
    right, up = np.clip(gaze_deg.T / FULL_LOOK_DEG, -1.0, 1.0)
    to_right, to_left = np.maximum(right, 0.0), np.maximum(-right, 0.0)
    looks = {"EyeLookOutRight": to_right, "EyeLookInLeft": to_right}
    looks |= {"EyeLookInRight": to_left, "EyeLookOutLeft": to_left}
    for side in ("Left", "Right"):
        looks[f"EyeLookUp{side}"], looks[f"EyeLookDown{side}"] = np.maximum(up, 0.0), np.maximum(-up, 0.0)
    return looks


def timecode(frame: int, fps: float) -> str:
    """HH:MM:SS:FF.mmm, the last part thousandths of a frame (they matter at fractional rates)."""
    seconds = int(frame / fps + 1e-9)
    within = max(0.0, frame - seconds * fps)
    whole = int(within + 1e-9)
    thousandths = min(999, round(max(0.0, within - whole) * 1000))
    clock = f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"
    return f"{clock}:{whole:02d}.{thousandths:03d}"


# Curves as a Python script for Blender that sets f-curves on shape keys.

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


# Curves as a glTF 2.0 animation of morph-target weights, in one file.

_FLOAT, _ARRAY_BUFFER = 5126, 34962


def to_gltf(
    curve: AnimationCurve, node: str = "face", left: str = "eyeBlinkLeft", right: str = "eyeBlinkRight"
) -> str:
    """Return a scene of one node whose mesh has two morph targets, and their animation.

    The mesh is a card of two lids (four triangles), so that the file can be looked at by itself; programs
    carry the animation over to a face by the names of node and targets.
    """
    eyes = [_eye(-0.035), _eye(0.005)]
    positions = np.concatenate(eyes)
    shift = np.zeros((2, *positions.shape), dtype=np.float32)
    for eye in range(2):
        shift[eye, eye * 6 : eye * 6 + 6, 1] = np.where(eyes[eye][:, 1] > 0, -0.01, 0.0)
    times = (np.arange(curve.left.size) / curve.fps).astype(np.float32)
    weights = np.stack([curve.left, curve.right], axis=1).astype(np.float32)
    parts = [positions, shift[0], shift[1], times, weights]
    offsets = np.concatenate([[0], np.cumsum([part.nbytes for part in parts])]).tolist()
    data = base64.b64encode(b"".join(part.astype("<f4").tobytes() for part in parts)).decode()
    primitive = {"attributes": {"POSITION": 0}, "targets": [{"POSITION": 1}, {"POSITION": 2}]}
    content = {
        "asset": {"version": "2.0", "generator": "Palpebra"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": node, "mesh": 0}],
        "meshes": [
            {
                "name": node,
                "primitives": [primitive],
                "weights": [0, 0],
                "extras": {"targetNames": [left, right]},
            }
        ],
        "animations": [
            {
                "name": "blinks",
                "samplers": [{"input": 3, "output": 4, "interpolation": "LINEAR"}],
                "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}],
            }
        ],
        "accessors": [
            *(_points(index, part) for index, part in enumerate(parts[:3])),
            {**_scalars(3, times), "min": [float(times.min())], "max": [float(times.max())]},
            _scalars(4, weights),
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": offsets[index], "byteLength": part.nbytes}
            | ({"target": _ARRAY_BUFFER} if index < 3 else {})
            for index, part in enumerate(parts)
        ],
        "buffers": [{"byteLength": offsets[-1], "uri": f"data:application/octet-stream;base64,{data}"}],
    }
    return json.dumps(content) + "\n"


def _eye(left_m: float) -> np.ndarray:
    """Two triangles (6, 3), 30 mm wide and 10 mm high, in m."""
    x = np.array([0, 1, 1, 0, 1, 0]) * 0.03 + left_m
    y = np.array([0, 0, 1, 0, 1, 1]) * 0.01
    return np.stack([x, y, np.zeros(6)], axis=1).astype(np.float32)


def _points(view: int, points: np.ndarray) -> dict[str, object]:
    bounds = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
    return {"bufferView": view, "componentType": _FLOAT, "count": len(points), "type": "VEC3", **bounds}


def _scalars(view: int, values: np.ndarray) -> dict[str, object]:
    return {"bufferView": view, "componentType": _FLOAT, "count": values.size, "type": "SCALAR"}


# Curves as a Maya .anim file, to import with the animImportExport plug-in.

_NAMED_UNITS = {15: "game", 24: "film", 25: "pal", 30: "ntsc", 48: "show", 50: "palf", 60: "ntscf"}
# fmt: off
_NUMBERED_UNITS = (
    2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 40, 75, 80, 100, 120, 125, 150, 200, 240, 250, 300, 375, 400, 500, 600,
    750,
)
# fmt: on


def time_unit(fps: float) -> str:
    """Maya's name of a frame rate; rates it cannot name are refused."""
    rate = round(fps)
    if abs(rate - fps) < 1e-6 and rate in _NAMED_UNITS:
        return _NAMED_UNITS[rate]
    if abs(rate - fps) < 1e-6 and rate in _NUMBERED_UNITS:
        return f"{rate}fps"
    known = sorted([*_NAMED_UNITS, *_NUMBERED_UNITS])
    near = min(known, key=lambda unit: abs(unit - fps))
    raise InputError(f"Maya has no time unit of {fps:g} frames per second; the nearest is --fps {near}")


def to_maya(
    curve: AnimationCurve, node: str = "face", left: str = "eyeBlinkLeft", right: str = "eyeBlinkRight"
) -> str:
    """One unitless curve per eye on `node`, one key per frame, linear between them."""
    header = [
        "animVersion 1.1;",
        "mayaVersion 2024;",
        f"timeUnit {time_unit(curve.fps)};",
        "linearUnit cm;",
        "angularUnit deg;",
        "startTime 0;",
        f"endTime {curve.left.size - 1};",
    ]
    curves = _anim(node, left, 0, curve.left) + _anim(node, right, 1, curve.right)
    return "\n".join(header + curves) + "\n"


def _anim(node: str, attribute: str, index: int, values: Array) -> list[str]:
    keys = [f"    {frame} {value:.6f} linear linear 1 1 0;" for frame, value in enumerate(values)]
    return [
        f"anim {attribute} {attribute} {node} 0 0 {index};",
        "animData {",
        "  input time;",
        "  output unitless;",
        "  weighted 0;",
        "  preInfinity constant;",
        "  postInfinity constant;",
        "  keys {",
        *keys,
        "  }",
        "}",
    ]


# Curves as a USD skeleton animation of blend-shape weights (text form, .usda).

_IDENTIFIER = re.compile(r"[A-Za-z_]\w*")


def to_usd(
    curve: AnimationCurve, node: str = "face", left: str = "eyeBlinkLeft", right: str = "eyeBlinkRight"
) -> str:
    """Return a layer with one SkelAnimation, /`node`/blinks, to bind to a face as its animation source.

    Raises
    ------
    InputError
        If `node` is not a valid USD name.
    """
    if not _IDENTIFIER.fullmatch(node):
        raise InputError(f"--target '{node}': expected letters, digits and _, not starting with a digit")
    samples = ",\n".join(
        f"                {frame}: [{one:g}, {other:g}]"
        for frame, (one, other) in enumerate(zip(curve.left, curve.right, strict=True))
    )
    return f"""#usda 1.0
(
    defaultPrim = "{node}"
    doc = "Blinks by Palpebra"
    endTimeCode = {curve.left.size - 1}
    framesPerSecond = {curve.fps:g}
    startTimeCode = 0
    timeCodesPerSecond = {curve.fps:g}
)

def SkelRoot "{node}"
{{
    def SkelAnimation "blinks"
    {{
        uniform token[] blendShapes = ["{left}", "{right}"]
        float[] blendShapeWeights.timeSamples = {{
{samples},
        }}
    }}
}}
"""


# Programs that animate a photograph: how open each eye is, frame by frame.

OPEN_EYE = 0.3
"""Distance of the lids over the width of an eye that looks ahead; each photograph has its own."""
LIVEPORTRAIT_HEIGHTS, DITTO_HEIGHTS = 1, 3
"""LivePortrait measures the lids' distance once, Ditto adds that of three places (its `EyeAttrUtilsByMP`)."""


def to_eye_ratios(curve: AnimationCurve, heights: int) -> str:
    """Lines of two numbers, lids' distance over the eye's width, for `numpy.loadtxt(file, delimiter=",")`.

    The first number is of the eye on the left of the picture, which is the person's right eye.
    """
    shut = np.column_stack([curve.right, curve.left])
    ratios = heights * OPEN_EYE * (1.0 - shut)
    lines = [f"# {curve.fps:g} fps; eye on the picture's left, on its right"]
    return "\n".join([*lines, *(f"{left:.4f},{right:.4f}" for left, right in ratios.tolist()), ""])


# Every format a curve can be written in, and the names it writes the eyes under.

_SAFE_NAME = re.compile(r"[A-Za-z_][\w.:|-]*")


@dataclass(frozen=True)
class CurveTarget:
    """The object (Blender) or node (Maya) that has the shapes, and what each eye's shape is called."""

    name: str = ""
    left: str = "eyeBlinkLeft"
    right: str = "eyeBlinkRight"


FORMATS: Mapping[str, Callable[[AnimationCurve, CurveTarget], str]] = {
    "csv": lambda curve, _: to_csv(curve),
    "json": lambda curve, _: to_json(curve),
    "blender": lambda curve, target: to_blender(curve, target.name, target.left, target.right),
    "maya": lambda curve, target: to_maya(curve, target.name or "face", target.left, target.right),
    "arkit": lambda curve, _: to_arkit(curve),
    "gltf": lambda curve, target: to_gltf(curve, target.name or "face", target.left, target.right),
    "usd": lambda curve, target: to_usd(curve, target.name or "face", target.left, target.right),
    "liveportrait": lambda curve, _: to_eye_ratios(curve, LIVEPORTRAIT_HEIGHTS),
    "ditto": lambda curve, _: to_eye_ratios(curve, DITTO_HEIGHTS),
}


def check_format(format_name: str, target: CurveTarget, option: str = "--format") -> None:
    """Refuse an unknown format, a name that a program could not take, or one name for both eyes.

    Parameters
    ----------
    option : str
        Which the format is given by.
    """
    if format_name not in FORMATS:
        near = nearest(format_name, FORMATS)
        raise InputError(
            f"unknown {option} '{format_name}'; expected one of: {', '.join(FORMATS)}"
            + (f"; did you mean '{near}'?" if near else "")
        )
    named = {"--left": target.left, "--right": target.right, "--target": target.name or "face"}
    for named_by, name in named.items():
        if not _SAFE_NAME.fullmatch(name):
            raise InputError(f"{named_by} '{name}': expected a name of letters, digits and _ . : | -")
    if target.left == target.right:
        raise InputError(f"--left and --right are both '{target.left}': each eye needs a separate shape")


def write_curve(format_name: str, curve: AnimationCurve, target: CurveTarget) -> str:
    """Return the curve as text in one of `FORMATS`; refuses what `check_format` refuses."""
    check_format(format_name, target)
    return FORMATS[format_name](curve, target)
