"""What `stimuli track` and `train` print: what a model was trained on, how a track went, warnings."""

import sys
from pathlib import Path

from experiments.errors import counted
from stimuli_builder.tracking.learn import Lesson
from stimuli_builder.tracking.outcome import TrackSummary

REASONS_TOLD = 6


def warn(line: str) -> None:
    """Print a warning on stderr, unless there is nothing to say."""
    if line:
        sys.stderr.write(f"warning: {line}\n")


def report_track(out: Path, summary: TrackSummary, prepared_s: float) -> None:
    """Print how many frames were tracked, doubtful and lost, how fast, and the usual reasons."""
    print(
        f"{out}: {summary.frames:,} frames, {summary.tracked:,} tracked "
        f"({summary.doubtful:,} of them doubtful), {summary.reinitialised:,} re-initialised, "
        f"{summary.lost:,} lost\n"
        f"{summary.fit_fps:,.0f} frames/s fit only, "
        f"{summary.end_to_end_fps:,.0f} frames/s with decoding; "
        f"{summary.total_s:,.1f} s after {prepared_s:,.1f} s for the model"
    )
    usual = sorted(summary.reasons.items(), key=lambda entry: -entry[1][0])
    for (status, _), (number, first, whole) in usual[:REASONS_TOLD]:
        print(f"{counted(number, 'frame')} {status}, the first is {first}: {whole}")
    if summary.tracked == summary.doubtful:
        warn("no frame is beyond doubt; look at a --preview before using any number")


def report_modes(lesson: Lesson) -> None:
    """Print how many frames trained and how much of their variance is kept."""
    model = lesson.model
    kept = [f"{share:.1%}" for share in model.variance_kept]
    print(
        f"trained on {len(model.examples)} frames: {model.mode_counts[0]} shape modes ({kept[0]}), "
        f"{model.mode_counts[1]} appearance modes ({kept[1]}), "
        f"{model.mode_counts[2]} coupled modes ({kept[2]}), "
        f"{model.mesh.pixel_count:,} base pixels, labels {'refined' if lesson.refined else 'as given'}"
    )
