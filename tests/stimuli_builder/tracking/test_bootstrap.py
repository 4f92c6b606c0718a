"""Labels proposed by a landmark detector; none is installed here, a stand-in sees the exact landmarks."""

import sys
from importlib.machinery import ModuleSpec
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from stimuli_builder.tracking.bootstrap import LEFT, RIGHT
from stimuli_builder.tracking.labels import load_labels


def test_label_bootstrap_without_its_extra_or_weights(stimuli, recording, tmp_path):
    from importlib.util import find_spec

    out = tmp_path / "labels.json"
    code, _, error = stimuli("label", recording.video, "--bootstrap", "--out", out)
    assert code == 2
    assert ("pip install 'mediapipe>=1.2'" if find_spec("mediapipe") is None else "--weights") in error
    assert "expected --bootstrap" in stimuli("label", recording.video, "--out", out)[2]
    assert not out.exists()


def test_accuracy_of_files_that_do_not_belong_together(stimuli, recording, tmp_path):
    other = tmp_path / "other.csv"
    other.write_text("\n".join(recording.truth.read_text().splitlines()[:50]) + "\n")
    code, _, error = stimuli("accuracy", other, recording.truth)
    assert code == 2
    assert "compare a track with its own truth" in error
    assert "not a track" in stimuli("accuracy", recording.labels, recording.truth)[2]


class FakeDetector:
    """Stands in for MediaPipe: sees the actor's exact landmarks, frame after frame; keeps the pictures."""

    def __init__(self, points, weights_open=True):
        self.points, self.weights_open, self.seen = points, weights_open, []

    def detect(self, image):
        self.seen.append(image.data)
        face = {}
        for place, (x, y) in zip((*LEFT, *RIGHT), self.points[len(self.seen) - 1], strict=True):
            face[place] = SimpleNamespace(x=(x + 0.5) / 512, y=(y + 0.5) / 384)
        return SimpleNamespace(face_landmarks=[face] if len(self.seen) % 7 else [])

    def create_from_options(self, options):
        if not self.weights_open:
            raise RuntimeError("Unable to open zip archive.")
        return self

    def install(self, monkeypatch):
        plain = {"Image": lambda image_format, data: SimpleNamespace(data=data)}
        plain["ImageFormat"] = SimpleNamespace(SRGB=1)
        python = {"BaseOptions": lambda model_asset_path: model_asset_path}
        vision = {"FaceLandmarkerOptions": lambda base_options: base_options, "FaceLandmarker": self}
        modules = {"": plain, ".tasks": {}, ".tasks.python": python, ".tasks.python.vision": vision}
        for name, members in modules.items():
            module = ModuleType("mediapipe" + name)
            module.__spec__ = ModuleSpec("mediapipe" + name, None, is_package=True)
            module.__dict__.update(members)
            monkeypatch.setitem(sys.modules, "mediapipe" + name, module)


def test_label_bootstrap_proposes_what_the_detector_sees(stimuli, recording, tmp_path, monkeypatch):
    detector, out, weights = FakeDetector(recording.points), tmp_path / "l.json", tmp_path / "w.task"
    detector.install(monkeypatch)
    weights.write_bytes(b"weights")
    code, said, _ = stimuli(
        "label", recording.video, "--bootstrap", "--weights", weights, "--frames", 12, "--out", out
    )
    assert code == 0
    assert "12 frames proposed" in said
    labels = load_labels(out, (512, 384), 200)
    assert len(labels.frames) == 12
    for number, points in labels.frames.items():
        assert points == pytest.approx(recording.points[number], abs=0.001)
    assert len(detector.seen) == 200
    assert detector.seen[0].shape == (384, 512, 3)
    assert np.ptp(detector.seen[0].astype(float).mean((0, 1))) > 20


def test_label_bootstrap_with_weights_that_are_none(stimuli, recording, tmp_path, monkeypatch):
    FakeDetector(recording.points, weights_open=False).install(monkeypatch)
    out, weights = tmp_path / "l.json", tmp_path / "w.task"
    weights.write_bytes(b"no weights")
    code, _, error = stimuli("label", recording.video, "--bootstrap", "--weights", weights, "--out", out)
    assert (code, error.count("\n")) == (2, 1)
    assert "not a face_landmarker.task that MediaPipe takes (Unable to open zip archive.)" in error
    assert not out.exists()
