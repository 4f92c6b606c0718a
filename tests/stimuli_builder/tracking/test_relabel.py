"""`--relabel` and proposed labels: only what a person changed or accepted counts as labelled by hand."""

import csv
import json

import numpy as np
import pytest

from stimuli_builder.tracking.labelfree import proposed_labels, write_relabel
from stimuli_builder.tracking.labels import as_proposed, by_hand, load_labels, unmarked_note
from stimuli_builder.tracking.shapes import default_markers
from stimuli_builder.tracking.survey import Survey
from stimuli_builder.video import scan_video


@pytest.fixture
def seen(recording):
    rng = np.random.default_rng(4)
    points = {n: recording.points[n] + rng.normal(0, 0.6, (18, 2)) for n in range(0, 200, 5)}
    return Survey(points, 40, 0)


@pytest.fixture
def track(stimuli, recording, tmp_path, monkeypatch, seen):
    """Track the actor without labels, a noisy witness in the detector's place: rows and what was printed."""
    monkeypatch.setattr("stimuli_builder.tracking.cli_track.survey", lambda *_, **__: seen)

    def run(*more):
        out = tmp_path / "t.csv"
        worst = ("--out", out, "--relabel", tmp_path / "worst.json")
        code, said, error = stimuli(
            "track", recording.video, "--no-refine", "--base-pixels", 1000, *worst, *more
        )
        assert code == 0, error
        with out.open() as stream:
            return list(csv.DictReader(stream)), said, error

    return run


@pytest.fixture
def proposals(recording, tmp_path):
    """A file of `--relabel` as it is written first."""
    info, path = scan_video(recording.video), tmp_path / "worst.json"
    write_relabel(path, info, default_markers(2), {n: recording.points[n] for n in (3, 9, 50, 80)}, {})
    return path


def changed(path, change):
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))


def test_a_second_run_on_proposals_that_nobody_touched_is_the_first_again(track, tmp_path):
    rows, said, _ = track()
    assert "worst.json: 0 frames corrected or accepted, which count; 9 as proposed, which do not" in said
    before = (tmp_path / "worst.json").read_bytes()
    again, said, error = track()
    assert again == rows
    assert "0 frames corrected or accepted, which count; 9 as proposed, which do not" in said
    assert (tmp_path / "worst.json").read_bytes() == before
    assert error == ""


def test_moved_and_accepted_frames_count_and_the_others_are_proposed_again(track, tmp_path, recording, seen):
    track()
    worst = tmp_path / "worst.json"
    first, second, *_ = json.loads(worst.read_text())["frames"]

    def correct_one_accept_another(document):
        document["frames"][first] = recording.points[int(first)].tolist()
        del document["proposed"][second]

    changed(worst, correct_one_accept_another)
    accepted = json.loads(worst.read_text())["frames"][second]
    _, said, _ = track()
    assert "2 frames corrected or accepted, which count" in said
    labels = load_labels(worst)
    assert by_hand(labels).frames.keys() == {int(first), int(second)}
    assert labels.frames[int(first)] == pytest.approx(recording.points[int(first)], abs=1e-3)
    assert labels.frames[int(second)].tolist() == accepted


def test_what_the_page_saves_of_proposals_is_by_hand_to_the_last_frame(proposals):
    def as_the_page_saves_one_accepted(document):
        document["frames"] = dict(list(document["frames"].items())[:1])
        document["proposed"] = {}

    assert not by_hand(load_labels(proposals)).frames
    changed(proposals, as_the_page_saves_one_accepted)
    labels = load_labels(proposals, fewest=1)
    assert by_hand(labels).frames.keys() == labels.frames.keys()
    assert unmarked_note(labels) == ""


def test_a_file_of_before_without_proposals_counts_whole_and_is_reported(proposals):
    changed(proposals, lambda document: document.pop("proposed"))
    labels = load_labels(proposals)
    assert by_hand(labels).frames.keys() == labels.frames.keys()
    assert "wrote it without proposals, so all its 4 frames count as corrected" in unmarked_note(labels)


def test_a_file_of_two_eyes_is_refused_for_one(proposals, stimuli, recording, tmp_path):
    more = ("--one-eye", "--relabel", proposals)
    code, _, error = stimuli("track", recording.video, "--out", tmp_path / "u.csv", *more)
    assert code == 2
    assert "has 18 points per frame, but --one-eye expects 9" in error


@pytest.mark.parametrize(
    ("wrong", "line"), [([], "found list"), ({"12": [1]}, "proposed frame 12: expected 18")]
)
def test_proposals_that_are_none_are_refused(document, tmp_path, stimuli, recording, wrong, line):
    document["proposed"] = wrong
    path = tmp_path / "labels.json"
    path.write_text(json.dumps(document))
    code, _, error = stimuli("track", recording.video, "--labels", path, "--out", tmp_path / "t.csv")
    assert code == 2
    assert line in error
    assert error.count("\n") == 1


@pytest.mark.parametrize("command", ["track", "train"])
def test_labels_that_nobody_reviewed_are_reported(command, stimuli, recording, tmp_path, seen):
    labels, out = tmp_path / "l.json", tmp_path / ("t.csv" if command == "track" else "m.npz")
    proposed_labels(scan_video(recording.video), seen, labels, 12)
    assert len(as_proposed(load_labels(labels))) == 12
    given = (command, recording.video, "--labels", labels, "--out", out)
    given += ("--no-refine", "--folds", 2, "--base-pixels", 1000)
    code, _, error = stimuli(*given)
    assert code == 0
    assert "warning: " in error
    assert "12 of 12 frames are unreviewed proposals" in error
    changed(labels, lambda document: document.update(proposed={}))
    assert "unreviewed proposals" not in stimuli(*given)[2]
    changed(labels, lambda document: document.pop("proposed"))
    assert "has no proposals, so reviewed frames cannot be identified" in stimuli(*given)[2]
