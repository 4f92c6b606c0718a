"""Two real recordings, if they are next to the checkout."""

import numpy as np
import pytest

from stimuli_builder.blinks.labelling import label_blinks
from stimuli_builder.tracking.learn import learn
from stimuli_builder.tracking.model import TrainingOptions
from stimuli_builder.tracking.table import distance_columns, numbers, track_rows
from stimuli_builder.tracking.track import track_video
from stimuli_builder.video import scan_video

CLIPS = {
    "single_face": {"one_eye": False, "blinks": [27], "rms_px": 1.0},
    "short_human_3blink": {"one_eye": True, "blinks": [24, 138, 209], "rms_px": 7.0},
}


@pytest.mark.parametrize("name", CLIPS)
def test_real_clip_is_tracked_throughout_and_its_blinks_are_found(shared_data, tmp_path, name):
    expected = CLIPS[name]
    info = scan_video(shared_data / "face_video" / f"{name}.mp4")
    labels = shared_data / "face_video" / f"{name}.points.json"
    lesson = learn(info, labels, TrainingOptions(), one_eye=expected["one_eye"])
    held_out = [result.rms_px for result in lesson.held_out]
    assert None not in held_out
    assert np.sqrt(np.mean(np.square(held_out))) < expected["rms_px"]
    out = tmp_path / "track.csv"
    summary = track_video(lesson.model, info, out)
    assert (summary.tracked, summary.lost, summary.reinitialised) == (info.frame_count, 0, 0)
    gaps = distance_columns(lesson.labels.eyes)
    distance = np.array([numbers(row, gaps, name).mean() for row in track_rows(out)])
    found = [blink.minimum for blink in label_blinks(distance, info.fps)]
    assert len(found) == len(expected["blinks"])
    assert np.abs(np.array(found) - expected["blinks"]).max() <= 4
