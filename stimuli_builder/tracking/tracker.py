"""Tracking from frame to frame: each ends fitted, or with a status and a reason, never as a wrong number."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from stimuli_builder.tracking.certainty import (
    DIFFERING_SHARE,
    doubt,
    fits_badly,
    glare_hides,
    lid_difference,
    stated_errors,
)
from stimuli_builder.tracking.fit import Fit, Fitter
from stimuli_builder.tracking.glare import GlareCheck
from stimuli_builder.tracking.mesh import reduced_points, restored_points, same_picture, shows_something
from stimuli_builder.tracking.model import CoupledModel
from stimuli_builder.tracking.search import Faults, Finder
from stimuli_builder.tracking.shapes import (
    EYE_POINTS,
    Points,
    inter_eyelid_distances,
    similarity_between,
    undo_pose,
    widths,
    with_border,
)
from stimuli_builder.tracking.stillness import Light, Stillness
from stimuli_builder.tracking.table import Status, TrackedFrame
from stimuli_builder.video import Picture

# A fit begun from what a detector saw.

# Below the fit's own limit (LIMIT_SD), so that it has room to move from there.
MAX_SD = 3.0
"""Coupled parameters start within this many of their standard deviations."""


class DetectedStart:
    """Turns a detector's points into coupled parameters and fits from there."""

    def __init__(self, fitter: Fitter) -> None:
        self._fitter = fitter
        self._to_parameters = _to_parameters(fitter.model)

    def fit(self, picture: Picture, points: Points) -> Fit:
        """Fit a reduced picture from points (9 * eyes, 2) in pixels of the video."""
        model = self._fitter.model
        shape = reduced_points(with_border(points), model.reduction)
        mean = model.mesh.vertices
        pose = similarity_between(mean, shape)
        away = (undo_pose(shape, pose) - mean).ravel()
        limit = MAX_SD * model.sd
        return self._fitter.fit(picture, np.clip(self._to_parameters @ away, -limit, limit), pose)


def _to_parameters(model: CoupledModel) -> NDArray[np.float64]:
    """Matrix (l, 2 V) from movements of the vertices to coupled parameters, least squares kept small."""
    modes = model.shape_modes.reshape(len(model.sd), -1)
    # The ridge is scaled by the modes' variance: a mode that hardly varies in people is hardly used to
    # explain a detector.
    size = (modes**2).sum(1).mean() * model.sd.max() ** 2
    ridge = 1e-3 * np.diag(size / np.maximum(model.sd, 1e-9) ** 2)
    return np.asarray(np.linalg.solve(modes @ modes.T + ridge, modes))


Values = NDArray[np.float64]

FROZEN = "the same picture as the frame before"
STILL = "the lids have not moved for two seconds: the picture may be frozen"
UNSEEN = "the detector finds no such eyes here, or they are partly outside the picture"
BLANK_RANGE = 12
"""Gray levels between the darkest and the brightest pixel below which a picture shows nothing."""
WORSE = 1.1
"""A fit from the detector may have so much more residual than the one it replaces."""
# A blink or a hand passes within a second; after that the person has most likely moved.
NEAR_EVERY_FRAME = 30
NEAR_LATER_EVERY = 5
# A search of the whole picture costs as much as many frames: after 1, 2, 4, 8 ... lost frames, then every
# 30.
WHOLE_EVERY = 30


class Tracker:
    """Follows the eyes from frame to frame; give it reduced pictures in order.

    Parameters
    ----------
    fps : float, optional
        Frames a second; without it nobody asks whether the lids stand still for seconds.
    """

    def __init__(self, model: CoupledModel, fps: float | None = None):
        self.model = model
        self._stillness = None if fps is None else Stillness(fps)
        self._fitter = Fitter(model)
        self._faults = Faults(model)
        self._glare = GlareCheck(model)
        self._finder = Finder(self._fitter)
        self._last: Fit | None = None
        self._lost_frames = 0
        self._started = False
        self._picture: Picture | None = None
        self._light = Light()
        self._before: Points | None = None
        self._loss = ""
        self._unseen = ""
        self._from_detection = DetectedStart(self._fitter)

    def look(self, hint: Points | str) -> None:
        """Take in that a detector looks at the next frame: after one that sees nothing, fits are doubtful.

        A patch of cheek or wall may pass for eyes, and between two looks nothing else reveals it.

        Parameters
        ----------
        hint : float64 array (9 * eyes, 2) or str
            What it sees, or why nothing.
        """
        self._unseen = hint if isinstance(hint, str) else ""

    def step(self, picture: Picture, hint: Points | None = None) -> TrackedFrame:
        """Fit the next frame, searching for the eyes where they are not where they were.

        Parameters
        ----------
        hint : float64 array (9 * eyes, 2), optional
            Points of a detector in pixels of the video: a second start where the fit from the frame before
            fails or lies elsewhere, and a witness.
        """
        blank = self._blank(picture)
        if blank:
            self._lose()
            self._loss = blank
            return TrackedFrame("lost", blank, None, None, None, 0)
        # Compared as recorded: in another light two equal pictures may differ by rounding.
        frozen = self._picture is not None and same_picture(picture, self._picture)
        self._picture = picture
        raw, picture = picture, self._light.evened(picture)
        if self._last is not None and not self._lost_frames:
            fit = self._fitter.fit(picture, self._last.c, self._last.pose)
            fault = self._faults.lost(fit, picture)
            fit, fault = self._with_hint(picture, fit, fault, hint)
            still = FROZEN if frozen else ""
            if not fault:
                return self._accepted(fit, "tracked", still, hint, raw)
            fit, fault = self._in_other_light(raw, self._last, fit, fault)
            if not fault:
                return self._accepted(fit, "tracked", still, hint)
            self._loss = fault
        elif hint is not None:
            fit = self._from_detection.fit(picture, hint)
            if not self._faults.lost(fit, picture):
                started, loss = self._started, self._loss
                again = f"found again after {loss}" if started else ""
                return self._accepted(fit, "reinitialised" if started else "tracked", again, hint)
        return self._search(raw, picture)

    def _in_other_light(self, raw: Picture, start: Fit, fit: Fit, fault: str) -> tuple[Fit, str]:
        """A failed fit, or where it passes one from the same start in the light of the picture there."""
        # A single iteration, to sample the picture where the eyes last were before the fit runs away from
        # it.
        begun = self._fitter.fit(self._light.evened(raw), start.c, start.pose, 1)
        light = self._light.then(*begun.light)
        if not light.believable or Light().then(*begun.light).steady:
            return fit, fault
        picture = light.evened(raw)
        other = self._fitter.fit(picture, start.c, start.pose)
        if self._faults.lost(other, picture):
            return fit, fault
        self._light = light
        return other, ""

    def _fits_badly(self, fit: Fit) -> bool:
        """Whether the picture alone makes a fit doubtful, which keeps its light from being followed."""
        return fits_badly(stated_errors(self.model, fit, None), widths(self._points(fit)))

    def _in_better_light(self, raw: Picture, fit: Fit) -> Fit:
        """A fit, or one from it in another light where the picture is explained better.

        A light followed to a shadow's end would else stay: doubtful frames are not followed.
        """
        for light in list(self._other_lights(fit)):
            picture = light.evened(raw)
            other = self._fitter.fit(picture, fit.c, fit.pose)
            if WORSE * other.overall_residual < fit.overall_residual and not self._faults.lost(
                other, picture
            ):
                fit, self._light = other, light
        return fit

    def _blank(self, picture: Picture) -> str:
        """Why a picture cannot show an eye, or an empty string."""
        return "" if shows_something(picture, BLANK_RANGE, 4) else "a black or empty frame"

    def _with_hint(self, picture: Picture, fit: Fit, fault: str, hint: Points | None) -> tuple[Fit, str]:
        """The fit, or one started from the detector where that is nearer to it and no worse a picture."""
        if hint is None:
            return fit, fault
        # Well within what is believed: a second fit would cost time and could only agree.
        if not fault and lid_difference(self._points(fit), hint) < DIFFERING_SHARE / 2:
            return fit, fault
        other = self._from_detection.fit(picture, hint)
        wrong = self._faults.lost(other, picture)
        if not wrong and (fault or other.overall_residual < WORSE * fit.overall_residual):
            return other, ""
        return fit, fault

    def _points(self, fit: Fit) -> Points:
        count = EYE_POINTS * self.model.eyes
        return restored_points(fit.vertices[:count].astype(np.float64), self.model.reduction)

    def _search(self, raw: Picture, picture: Picture) -> TrackedFrame:
        best, fault = self._searched(picture)
        for light in self._other_lights(best) if fault else ():
            other, fault_there = self._searched(light.evened(raw))
            if other is not None and not fault_there:
                best, fault, self._light = other, "", light
                break
        if best is not None and not fault:
            if self._started:
                return self._accepted(best, "reinitialised", f"found again after {self._loss}")
            return self._accepted(best, "tracked", "")
        self._lose()
        self._loss = self._loss or fault or "no part of the picture resembles the labeled frames"
        residual = best.overall_residual if best is not None and best.iterations else None
        # What a detector says here and now explains more than what the loss began with.
        why = self._unseen or self._loss
        return TrackedFrame("lost", why, None, None, residual, best.iterations if best else 0)

    def _lose(self) -> None:
        self._lost_frames += 1
        if self._stillness is not None:
            self._stillness.forget()

    def _other_lights(self, best: Fit | None) -> Iterator[Light]:
        """The labeled light, where another was followed to the loss, and the one from a fit."""
        if self._light != Light():
            yield Light()
        told = Light() if best is None else self._light.then(*best.light)
        if told.believable and not told.steady:
            yield told

    def _searched(self, picture: Picture) -> tuple[Fit | None, str]:
        """The first attempt that passes, or the last one with its fault; None where no start was likely."""
        best: Fit | None = None
        fault = ""
        for attempt in self._attempts(picture):
            best, fault = attempt, self._faults.lost(attempt, picture)
            if not fault:
                break
        return best, fault

    def _attempts(self, picture: Picture) -> Iterator[Fit]:
        """Fits from likely starts: near the last place often, over the whole picture now and then."""
        count = self._lost_frames
        if self._last is not None and (count < NEAR_EVERY_FRAME or count % NEAR_LATER_EVERY == 0):
            near = self._finder.near(picture, self._last.pose)
            if near is not None:
                yield near
        # True for 0 and the powers of two.
        if count & (count - 1) == 0 or count % WHOLE_EVERY == 0:
            anywhere = self._finder.anywhere(picture)
            if anywhere is not None:
                yield anywhere

    def _accepted(
        self, fit: Fit, status: Status, reason: str, hint: Points | None = None, raw: Picture | None = None
    ) -> TrackedFrame:
        """The frame of a fit that passed; with its picture as recorded, `raw`, another light may be tried."""
        # After a search the eyes may be anywhere: a jump says nothing.
        before = self._before if status == "tracked" else None
        points, errors, why = self._judged(fit, before, hint)
        if why and raw is not None and self._fits_badly(fit):
            fit = self._in_better_light(raw, fit)
            points, errors, why = self._judged(fit, before, hint)
        self._last, self._lost_frames, self._started, self._loss = fit, 0, True, ""
        self._before = points
        # The light is learned from frames that are believed, else a hand would pass for a shadow.
        if not why:
            self._light = self._light.following(*fit.light)
        if self._stillness is not None and self._stillness.after(points):
            reason = reason or STILL
        if why or reason in (FROZEN, STILL):
            status, reason = "doubtful", why or reason
        distances = inter_eyelid_distances(points, self.model.markers)
        return TrackedFrame(status, reason, points, distances, fit.overall_residual, fit.iterations, errors)

    def _judged(self, fit: Fit, before: Points | None, hint: Points | None) -> tuple[Points, Values, str]:
        """Points of a fit, their stated errors, and why it may be wrong."""
        points = self._points(fit)
        difference = None if hint is None else lid_difference(points, hint)
        errors = stated_errors(self.model, fit, None if difference is None else difference * widths(points))
        why = (
            doubt(self.model, fit, points, errors, difference, before)
            or self._faults.flat(fit)
            or self._unseen
        )
        if self._picture is not None:
            # As recorded: evened light would move what is saturated.
            hidden, glare = self._glare.of(fit, self._picture)
            # In quadrature, as of independent errors; every point of an eye gets that eye's share.
            errors = np.hypot(errors, widths(points) * np.repeat(hidden, EYE_POINTS))
            why = why or glare or glare_hides(errors, widths(points))
        return points, errors, why
