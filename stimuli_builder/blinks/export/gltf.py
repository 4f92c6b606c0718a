"""Curves as a glTF 2.0 animation of morph-target weights, in one file."""

import base64
import json

import numpy as np

from stimuli_builder.blinks.export.curve import AnimationCurve

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
