"""From a video and its label file to a model that knows how well it fits frames it has not seen."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.errors import InputError
from stimuli_builder.tracking.accuracy import (
    Advance,
    HeldOut,
    cross_validate,
    refined_labels,
    residual_limits,
)
from stimuli_builder.tracking.certainty import with_errors
from stimuli_builder.tracking.labels import Labels, load_labels
from stimuli_builder.tracking.model import CoupledModel, TrainingOptions, train
from stimuli_builder.video import VideoInfo, read_frames, scan_before_damage, scan_video

WORTH_REFINING = 0.96
FOLDS = 5


@dataclass(frozen=True)
class Lesson:
    """A trained model, the labeled frames left out in turn, and whether labels were refined."""

    model: CoupledModel
    labels: Labels
    held_out: list[HeldOut]
    refined: bool


def open_video(path: Path, accept_variable_rate: bool = False, accept_damaged_end: bool = False) -> VideoInfo:
    """Scan a video and refuse a variable frame rate or a damaged end unless it is accepted."""
    info = scan_before_damage(path) if accept_damaged_end else scan_video(path)
    if info.variable and not accept_variable_rate:
        steps = np.diff(info.times_s) * 1000
        raise InputError(
            f"{path}: variable frame rate, steps of {steps.min():.1f} to {steps.max():.1f} ms; convert it to "
            "a constant rate, or keep its time stamps with --accept-variable-rate"
        )
    return info


def learn(
    info: VideoInfo,
    labels_path: Path,
    options: TrainingOptions,
    *,
    one_eye: bool,
    folds: int = FOLDS,
    refine: bool | None = None,
    advance: Advance = None,
) -> Lesson:
    """Train on the labeled frames of a video.

    Parameters
    ----------
    refine : bool, optional
        Make labels consistent with the pictures first; None does so where frames left out of training then
        come clearly nearer to their labels. Accuracy is always reported against the labels as given.
    advance : callable, optional
        Called after each of `training_steps`.
    """
    labels = load_labels(labels_path, info.size_px, info.frame_count)
    check_eyes(labels, one_eye)
    return lesson_from(info, labels, options, folds=folds, refine=refine, advance=advance)


def training_steps(folds: int = FOLDS, refine: bool | None = None) -> int:
    """Steps of a training: each fold, again with refined labels where both are compared, and the whole."""
    return folds * (2 if refine is None else 1) + 1


def lesson_from(
    info: VideoInfo,
    labels: Labels,
    options: TrainingOptions,
    *,
    folds: int = FOLDS,
    refine: bool | None = None,
    advance: Advance = None,
) -> Lesson:
    """Train on labels that are at hand, a person's or a detector's; see `learn`."""
    pictures = read_frames(info, list(labels.frames))
    given = (pictures, labels.frames, labels.markers, options)
    # Always on frames that were left out: errors on the training frames are of the model's size, not of its
    # truth.
    held_out = cross_validate(*given, folds, refine=bool(refine), advance=advance)
    refined = bool(refine)
    if refine is None:
        trial = cross_validate(*given, folds, refine=True, advance=advance)
        # Judged against the labels as given, else refining would be praised for agreeing with itself.
        if _typical(trial) < WORTH_REFINING * _typical(held_out):
            held_out, refined = trial, True
    points = refined_labels(*given) if refined else labels.frames
    frames = sorted(points)
    model = train(
        [pictures[f] for f in frames], np.array([points[f] for f in frames]), labels.markers, options
    )
    if advance is not None:
        advance()
    believed = with_errors(model, held_out, residual_limits(held_out, labels.eyes))
    return Lesson(believed, labels, held_out, refined)


def check_eyes(labels: Labels, one_eye: bool) -> None:
    """Refuse labels of two eyes for a close-up of one, and the other way round."""
    if one_eye and labels.eyes == 2:
        raise InputError(f"{labels.path}: has 18 points per frame, but --one-eye expects 9; remove --one-eye")
    if not one_eye and labels.eyes == 1:
        raise InputError(f"{labels.path}: has 9 points per frame, the labels of one eye; add --one-eye")


def _typical(results: list[HeldOut]) -> float:
    distances = [result.rms_px for result in results if result.rms_px is not None]
    return float(np.mean(distances)) if distances else float("inf")


# The accuracy report by fold, as lines of text.


def fold_lines(results: Sequence[HeldOut]) -> Iterator[str]:
    """One line a fold and one for all: RMS against labels, inter-eyelid distance, frames not found."""
    yield "accuracy on frames not used for training, in pixels of the video, compared with the given labels"
    names = ("fold", "frames", "RMS", "median", "worst", "distance bias", "sd")
    widths = (6, 7, 8, 8, 8, 14, 7)
    yield " ".join(f"{name:>{width}}" for name, width in zip(names, widths, strict=True)) + "  not found"
    for fold in sorted({result.fold for result in results}):
        yield _line(str(fold + 1), [result for result in results if result.fold == fold])
    yield _line("all", results)


def _line(name: str, results: Sequence[HeldOut]) -> str:
    rms_px = [r.rms_px for r in results if r.rms_px is not None]
    errors = [r.distance_errors_px for r in results if r.distance_errors_px is not None]
    missing = len(results) - len(rms_px)
    if not rms_px:
        return f"{name:>6} {len(results):>7} {'none of them found':>40}  {missing}"
    rms, gaps = np.array(rms_px), np.concatenate(errors)
    total = float(np.sqrt((rms**2).mean()))
    return (
        f"{name:>6} {len(results):>7} {total:>8.2f} {np.median(rms):>8.2f} {rms.max():>8.2f} "
        f"{gaps.mean():>+14.2f} {gaps.std():>7.2f}  {missing}"
    )
