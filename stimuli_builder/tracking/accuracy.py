"""How exact a track is: against labels of frames left out of training, and against known truth."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.tracking.fit import Fit, Fitter
from stimuli_builder.tracking.mesh import reduce_picture, restored_points
from stimuli_builder.tracking.model import CoupledModel, TrainingOptions, train
from stimuli_builder.tracking.search import Finder
from stimuli_builder.tracking.shapes import EYE_POINTS, LidMarkers, Points, inter_eyelid_distances, widths
from stimuli_builder.tracking.table import distance_columns, numbers, point_columns, track_rows
from stimuli_builder.video import Picture

Values = NDArray[np.float64]
Advance = Callable[[], None] | None
"""Called after each step of a training."""


@dataclass(frozen=True)
class HeldOut:
    """A labeled frame fitted by a model that never saw it, found without knowing its label.

    Attributes
    ----------
    rms_px : float or None
        Root mean square distance of the landmarks from the labels; None if the frame was not found.
    distance_errors_px : float64 array (eyes,) or None
        Inter-eyelid distance minus the label's.
    residuals : float64 array (eyes,) or None
        Root mean square gray levels.
    point_errors_px : float64 array (9 * eyes,) or None
        Distance of each landmark from its label.
    width_px : float or None
        Mean width of the labeled eyes.
    points : float64 array (9 * eyes, 2) or None
        Landmarks as fitted, in pixels of the video.
    """

    frame: int
    fold: int
    rms_px: float | None
    distance_errors_px: Values | None
    residuals: Values | None
    point_errors_px: Values | None = None
    width_px: float | None = None
    points: Points | None = None


def cross_validate(
    pictures: dict[int, Picture],
    points: dict[int, Points],
    markers: LidMarkers,
    options: TrainingOptions,
    folds: int,
    *,
    refine: bool = False,
    advance: Advance = None,
) -> list[HeldOut]:
    """Train on all folds but one and fit the labeled frames of that one, for every fold.

    Parameters
    ----------
    pictures, points : dict of int to Picture, dict of int to float64 array
        By frame number; points (9 * eyes, 2).
    folds : int
        Frame k of the ascending labeled frames is in fold k modulo `folds`.
    refine : bool, optional
        Refine the labels of the training frames of each fold, without sight of the frames left out.
    advance : callable, optional
        Called after each fold.
    """
    frames = sorted(points)
    # No fold without a frame to leave out.
    folds = min(folds, len(frames))
    results = []
    for fold in range(folds):
        # Interleaved, so that every fold has frames from all over the recording.
        out = [frame for index, frame in enumerate(frames) if index % folds == fold]
        kept = [frame for frame in frames if frame not in out]
        labels = {frame: points[frame] for frame in kept}
        # Within the fold: refining before would let the left-out frames shape the labels.
        if refine:
            labels = refined_labels(pictures, labels, markers, options)
        model = train([pictures[f] for f in kept], np.array([labels[f] for f in kept]), markers, options)
        finder = Finder(Fitter(model))
        for frame in out:
            results.append(_held_out(model, finder, frame, fold, pictures[frame], points[frame]))
        if advance is not None:
            advance()
    return sorted(results, key=lambda result: result.frame)


def _held_out(
    model: CoupledModel, finder: Finder, frame: int, fold: int, picture: Picture, label: Points
) -> HeldOut:
    small = reduce_picture(picture, model.reduction)
    # A typical place, known from the training frames alone.
    middle = np.median(model.poses, axis=0)
    # A track searches both ways; the better one counts.
    fits = [fit for fit in (finder.anywhere(small), finder.near(small, middle)) if fit is not None]
    if not fits:
        return HeldOut(frame, fold, None, None, None)
    # By the worse eye: a fit of one eye only is not found.
    fit: Fit = min(fits, key=lambda restored: float(restored.residuals.max()))
    # Back from the reduced picture to pixels of the video.
    restored = restored_points(fit.vertices[: len(label)].astype(np.float64), model.reduction)
    errors = inter_eyelid_distances(restored, model.markers) - inter_eyelid_distances(label, model.markers)
    away = np.hypot(*(restored - label).T)
    return HeldOut(frame, fold, _rms(restored - label), errors, fit.residuals, away, widths(label), restored)


def _rms(differences: Points) -> float:
    return float(np.sqrt((differences**2).sum(-1).mean()))


def residual_limits(results: Sequence[HeldOut], eyes: int) -> Values:
    """Residuals above which a fit is not believed: from how well unseen frames are fitted."""
    seen = [result.residuals for result in results if result.residuals is not None]
    if not seen:
        return np.full(eyes, np.inf)
    residuals = np.array(seen)
    # The larger of two: few labeled frames give an uncertain 90th percentile.
    return np.maximum(3 * np.median(residuals, axis=0), 1.5 * np.percentile(residuals, 90, axis=0))


def refined_labels(
    pictures: dict[int, Picture],
    points: dict[int, Points],
    markers: LidMarkers,
    options: TrainingOptions,
    rounds: int = 3,
) -> dict[int, Points]:
    """Labels made consistent with the pictures: each is replaced by the fit of a one-mode model to its frame.

    A person's labels scatter by a pixel; what many frames agree on does not.
    """
    # One mode cannot follow the scatter of single labels.
    plain = replace(options, shape_variance=0.0, fewest_shape_modes=1)
    frames = sorted(points)
    refined = {frame: points[frame] for frame in frames}
    for _ in range(rounds):
        model = train([pictures[f] for f in frames], np.array([refined[f] for f in frames]), markers, plain)
        fitter = Fitter(model)
        for index, frame in enumerate(frames):
            small = reduce_picture(pictures[frame], model.reduction)
            fit = fitter.fit(small, model.examples[index], model.poses[index])
            if fit.iterations:
                moved = fit.vertices[: EYE_POINTS * markers.eyes].astype(np.float64)
                refined[frame] = restored_points(moved, model.reduction)
    return refined


@dataclass(frozen=True)
class TruthReport:
    """A track against known truth; pixels. `blink_p95_px` is None where the truth has no blink."""

    frames: int
    lost: int
    reinitialised: int
    rms_px: float
    p95_px: float
    blink_p95_px: float | None
    distance_bias_px: float
    distance_sd_px: float


def compare_with_truth(track: Path, truth: Path) -> TruthReport:
    """Compare a track with the truth table of the synthetic actor, row by row."""
    errors: list[tuple[float, float, float, bool]] = []
    lost = again = 0
    names, gaps = point_columns(2), distance_columns(2)
    # `zip_longest`, so that a shorter table is noticed.
    for row, true in zip_longest(track_rows(track), track_rows(truth)):
        if row is None or true is None or row["frame"] != true["frame"]:
            raise InputError(
                f"{track}: its frames differ from those of {truth}; compare a track with its own ground truth"
            )
        # Swapped arguments would silently measure the truth against the track.
        if "status" in true and "status" not in row:
            raise InputError(
                f"expected a track (with a column 'status') and then its truth, got {track} and {truth}: "
                "swap them"
            )
        again += row.get("status") == "reinitialised"
        # A lost frame has no points; it is counted, not measured.
        if row.get("status") == "lost":
            lost += 1
            continue
        points = numbers(row, names, str(track)) - numbers(true, names, str(truth))
        distances = numbers(row, gaps, str(track)) - numbers(true, gaps, str(truth))
        errors.append((_rms(points.reshape(-1, 2)), *distances, bool(true.get("blink"))))
    if not errors:
        raise InputError(f"{track}: no tracked frame to compare")
    return _truth_report(np.array(errors), lost, again)


def _truth_report(errors: Values, lost: int, again: int) -> TruthReport:
    blinking = errors[:, 3] > 0
    return TruthReport(
        frames=len(errors) + lost,
        lost=lost,
        reinitialised=again,
        rms_px=float(np.sqrt((errors[:, 0] ** 2).mean())),
        p95_px=float(np.percentile(errors[:, 0], 95)),
        # Blinks apart: they are few frames, but those that matter.
        blink_p95_px=float(np.percentile(errors[blinking, 0], 95)) if blinking.any() else None,
        distance_bias_px=float(errors[:, 1:3].mean()),
        distance_sd_px=float(errors[:, 1:3].std()),
    )
