"""Tracking without labels on rendered faces, against exact lids: how far off, and whether the track knows.

    PYTHONPATH=. python tests/bench/bench_rendered_tracks.py KIT.npz [PICTURE.svg]

KIT is ICT-FaceKit's packed file (docs/characters.md). Eight recordings of 360 frames
(`rendered_recordings`): two faces, each at two sizes, and close-ups of four, with a blink every second, a
moving head, unsteady light, noise, blur and compression; every third run of 12 frames is spoilt as in
`bench_stated_error.py`. Lids are compared with the geometry the faces were rendered from: how far off the
detector and the track are, r of the lid distance, the stated error beside the true one, and how many wrong
frames are called `tracked`. PICTURE, where given, becomes the calibration curve. Nothing is fitted to these
recordings. Needs the detector's environment.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from bench_label_free import tell as tell_lids
from bench_stated_error import RUN, SPOILT, Compared, binned, compared, spoilt, tell, tracked_rows
from face_baking.kit import load_facekit
from matplotlib.figure import Figure
from rendered_recordings import recordings

from stimuli_builder.tracking.labelfree import label_free_lesson
from stimuli_builder.tracking.model import TrainingOptions
from stimuli_builder.tracking.shapes import Points, default_markers
from stimuli_builder.tracking.survey import survey
from stimuli_builder.tracking.table import numbers, point_columns
from stimuli_builder.video import Picture, scan_video


def every_third_run(number: int, picture: Picture, points: Points) -> Picture:
    """The picture, spoilt in one of four ways where its run of 12 frames is a third one."""
    run = number // RUN
    if run % 3 != 2:
        return picture
    rng = np.random.default_rng([number, 6])
    return spoilt(picture, SPOILT[run // 3 % 4], points, rng)


def tracked_without_labels(path: Path, truth: dict[int, Points], *, one_eye: bool) -> list[Compared]:
    """Stated and true lid error of every frame; prints the lids of the detector and the track on the way."""
    info = scan_video(path)
    seen = survey(info, one_eye=one_eye)
    markers = default_markers(1 if one_eye else 2)
    tell_lids("detector", seen.points, truth, markers)
    model = label_free_lesson(info, seen, TrainingOptions(), one_eye=one_eye).model
    rows = tracked_rows(info, model, seen.hints)
    columns = point_columns(model.eyes)
    given = {n: row for n, row in rows.items() if row["status"] != "lost"}
    points = {n: numbers(row, columns, info.path).reshape(-1, 2) for n, row in given.items()}
    tell_lids("track", points, truth, markers)
    return compared(rows, model.eyes, info.path, truth, along=False)


def curve(kinds: dict[str, list[Compared]], path: Path) -> None:
    """Draw stated against true error, by bins of the stated one, with the line of equality."""
    figure = Figure(figsize=(5, 5), layout="constrained")
    axes = figure.subplots()
    for kind, frames in kinds.items():
        known = [frame for frame in frames if frame.status != "lost"]
        stated, true = np.array([f.stated for f in known]), np.array([f.true for f in known])
        bins = [inside for _, _, inside in binned(known)]
        means = [[np.sqrt((values[inside] ** 2).mean()) for inside in bins] for values in (stated, true)]
        axes.plot(*means, "o-", label=f"{kind}, {len(known)} frames")
    end = max(axes.get_xlim()[1], axes.get_ylim()[1])
    axes.plot([0, end], [0, end], color="grey", linewidth=0.8, label="stated = true")
    axes.set(xlabel="stated error, % of the eye's width", ylabel="true error, % of the eye's width")
    axes.legend(frameon=False)
    figure.savefig(path)


def main() -> None:
    kit = load_facekit(Path(sys.argv[1]))
    kinds: dict[str, list[Compared]] = {"whole faces": [], "close-ups": []}
    with tempfile.TemporaryDirectory() as bare:
        for look, path, truth in recordings(kit, Path(bare), every_third_run):
            sys.stdout.write(f"{look.face}, eye {look.eye_px:g} px, CRF {look.crf}\n")
            frames = tracked_without_labels(path, truth, one_eye=look.one_eye)
            tell("  track", frames)
            sys.stdout.flush()
            kinds["close-ups" if look.one_eye else "whole faces"] += frames
    for kind, frames in kinds.items():
        tell(kind, frames)
    tell("together", [frame for frames in kinds.values() for frame in frames])
    if len(sys.argv) > 2:
        curve(kinds, Path(sys.argv[2]))


if __name__ == "__main__":
    main()
