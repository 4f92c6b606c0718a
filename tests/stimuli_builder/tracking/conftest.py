"""A short recording of the synthetic actor with truth and labels, and a model trained on it."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from stimuli_builder.actor.recording import Actor, ActorOptions, label_points, write_truth, write_video
from stimuli_builder.cli import main
from stimuli_builder.tracking.labels import Labels, save_labels
from stimuli_builder.tracking.learn import Lesson, learn
from stimuli_builder.tracking.model import TrainingOptions
from stimuli_builder.tracking.shapes import default_markers
from stimuli_builder.video import frames, scan_video


@dataclass(frozen=True)
class Recording:
    """Files of the clip, its pictures and exact landmarks (frames, 18, 2)."""

    video: Path
    truth: Path
    labels: Path
    pictures: list
    points: np.ndarray


@pytest.fixture(scope="session")
def recording(tmp_path_factory) -> Recording:
    folder = tmp_path_factory.mktemp("actor")
    actor = Actor(ActorOptions(seconds=1.0, fps=200, seed=3))
    video, truth, labels = folder / "actor.mp4", folder / "truth.csv", folder / "labels.json"
    write_video(actor, video, lambda: None)
    write_truth(actor, truth)
    points = label_points(actor, 20, 0.0)
    save_labels(Labels(labels, (512, 384), default_markers(2), points), video.name, "synthetic actor")
    exact = np.loadtxt(truth, delimiter=",", skiprows=1, usecols=range(2, 38)).reshape(-1, 18, 2)
    return Recording(video, truth, labels, list(frames(video)), exact)


@pytest.fixture(scope="session")
def lesson(recording) -> Lesson:
    return learn(
        scan_video(recording.video), recording.labels, TrainingOptions(), one_eye=False, refine=False
    )


@pytest.fixture
def document(recording) -> dict:
    """The label file as a dictionary, to be spoilt."""
    return json.loads(recording.labels.read_text())


@pytest.fixture
def stimuli(monkeypatch, capsys):
    """Run the command `stimuli` in this process: exit code, stdout, stderr."""

    def run(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr("sys.argv", ["stimuli", *map(str, arguments)])
        code = 0
        try:
            main()
        except SystemExit as end:
            code = int(end.code or 0)
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run
