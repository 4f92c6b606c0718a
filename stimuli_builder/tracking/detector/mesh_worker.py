"""MediaPipe's face mesh as a separate process: pictures in on stdin, contours out on stdout.

Runs in the environment of requirements.txt (numpy < 2) and imports nothing of this project. A message is
the length of its JSON head (8 bytes, little endian), the head, and for a request the picture (RGB, uint8).
Requests: {"op": "faces", "shape": [h, w, 3]}, or {"op": "eye", ..., "regions": [[x, y, side, flip, turn]]}:
middle and side of a square in pixels, mirrored or not, turned clockwise by so many degrees.
"""

import json
import os
import struct
import sys
from pathlib import Path
from typing import Any

replies = os.fdopen(os.dup(1), "wb")
os.dup2(2, 1)  # what libraries print must not get between the answers

import cv2  # noqa: E402
import mediapipe  # noqa: E402
import numpy as np  # noqa: E402
from mediapipe.python import packet_creator, packet_getter  # noqa: E402
from mediapipe.python._framework_bindings import calculator_graph, image_frame, resource_util  # noqa: E402

# Numbers of the mesh's 478 points: upper lid from outer to inner canthus, lower lid back, iris.
EYES = (
    (
        (33, 246, 161, 160, 159, 158, 157, 173, 133),
        (133, 155, 154, 153, 145, 144, 163, 7, 33),
        range(468, 473),
    ),
    (
        (263, 466, 388, 387, 386, 385, 384, 398, 362),
        (362, 382, 381, 380, 374, 373, 390, 249, 263),
        range(473, 478),
    ),
)
SIDE = 64
IRIS_GRAPH = """
input_stream: "image"
output_stream: "contour"
output_stream: "iris"
node { calculator: "ImageToTensorCalculator" input_stream: "IMAGE:image" output_stream: "TENSORS:picture"
  options { [mediapipe.ImageToTensorCalculatorOptions.ext] {
    output_tensor_width: 64 output_tensor_height: 64 keep_aspect_ratio: false
    output_tensor_float_range { min: 0.0 max: 1.0 } } } }
node { calculator: "InferenceCalculator" input_stream: "TENSORS:picture" output_stream: "TENSORS:both"
  options { [mediapipe.InferenceCalculatorOptions.ext] {
    model_path: "mediapipe/modules/iris_landmark/iris_landmark.tflite" delegate { xnnpack {} } } } }
node { calculator: "SplitTensorVectorCalculator" input_stream: "both" output_stream: "a" output_stream: "b"
  options { [mediapipe.SplitVectorCalculatorOptions.ext] {
    ranges: { begin: 0 end: 1 } ranges: { begin: 1 end: 2 } } } }
node { calculator: "TensorsToFloatsCalculator" input_stream: "TENSORS:a" output_stream: "FLOATS:contour" }
node { calculator: "TensorsToFloatsCalculator" input_stream: "TENSORS:b" output_stream: "FLOATS:iris" }
"""
# The iris network's first 16 points: lower lid 0 to 8 from the image-left canthus, upper lid 9 to 15.
LOWER, UPPER = range(9), (0, 9, 10, 11, 12, 13, 14, 15, 8)


class Faces:
    """The refined mesh on single pictures, without smoothing over time."""

    def __init__(self) -> None:
        mesh = mediapipe.solutions.face_mesh
        self._mesh = mesh.FaceMesh(
            static_image_mode=True, max_num_faces=3, refine_landmarks=True, min_detection_confidence=0.5
        )

    def __call__(self, picture: Any, head: Any) -> Any:  # noqa: ARG002 - both tools are called alike
        """Answer with every face's box, lids and irises."""
        height, width = picture.shape[:2]
        faces = self._mesh.process(picture).multi_face_landmarks or []
        answers = []
        for face in faces:
            # MediaPipe cuts its crops by pixel indices, so that 0 is the middle of the first pixel already.
            points = np.array([(p.x * width, p.y * height) for p in face.landmark])
            box = [*points.min(0).tolist(), *points.max(0).tolist()]
            eyes = [[points[list(part)].tolist() for part in eye] for eye in EYES]
            answers.append({"box": box, "eyes": eyes})
        return {"faces": answers}


class Eye:
    """The iris network on regions that hold one eye."""

    def __init__(self) -> None:
        resource_util.set_resource_dir(str(Path(mediapipe.__file__).parent.parent))
        self._graph = calculator_graph.CalculatorGraph(graph_config=IRIS_GRAPH)
        self._out: dict[str, Any] = {}
        self._time = 0
        for name in ("contour", "iris"):
            self._graph.observe_output_stream(name, self._keep)
        self._graph.start_run()

    def _keep(self, name: str, packet: Any) -> None:
        self._out[name] = np.array(packet_getter.get_float_list(packet)).reshape(-1, 3)[:, :2]

    def __call__(self, picture: Any, head: Any) -> Any:
        """Answer with lids and iris in each region."""
        blurred: dict[int, Any] = {}
        eyes = []
        for region in head["regions"]:
            blur = max(1, int(region[2] / SIDE))
            if blur not in blurred:
                blurred[blur] = cv2.blur(picture, (blur, blur))
            eyes.append(self._region(blurred[blur], *region))
        return {"eyes": eyes}

    def _region(self, blurred: Any, x: float, y: float, side: float, flip: bool, turn: float) -> Any:
        cos, sin = np.cos(np.radians(turn)), np.sin(np.radians(turn))
        upright = SIDE / side * np.array([[cos, sin], [-sin, cos]])
        away = np.array([SIDE / 2, SIDE / 2]) - upright @ [x, y]
        crop = cv2.warpAffine(
            blurred,
            np.column_stack([upright, away]),
            (SIDE, SIDE),
            flags=cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
        crop = np.ascontiguousarray(crop[:, ::-1] if flip else crop)
        self._time += 1
        packet = packet_creator.create_image(image_format=image_frame.ImageFormat.SRGB, data=crop)
        self._graph.add_packet_to_input_stream("image", packet.at(self._time))
        self._graph.wait_until_idle()
        landmarks = {}
        for name, points in self._out.items():
            points = points.copy()
            if flip:
                points[:, 0] = SIDE - 1 - points[:, 0]
            landmarks[name] = (points - away) @ np.linalg.inv(upright).T
        contour = landmarks["contour"]
        return [contour[list(UPPER)].tolist(), contour[list(LOWER)].tolist(), landmarks["iris"].tolist()]


def read(count: int) -> bytes:
    """Exactly `count` bytes of stdin; the process ends where it ends."""
    parts = sys.stdin.buffer.read(count)
    if len(parts) < count:
        sys.exit(0)
    return parts


def main() -> None:
    """Answer requests until stdin ends."""
    makers: dict[str, Any] = {"faces": Faces, "eye": Eye}
    tools: dict[str, Any] = {}
    while True:
        (length,) = struct.unpack("<q", read(8))
        head = json.loads(read(length))
        shape = head["shape"]
        picture = np.frombuffer(read(int(np.prod(shape))), np.uint8).reshape(shape)
        if head["op"] not in tools:
            tools[head["op"]] = makers[head["op"]]()
        answer = json.dumps(tools[head["op"]](picture, head)).encode()
        replies.write(struct.pack("<q", len(answer)) + answer)
        replies.flush()


if __name__ == "__main__":
    main()
