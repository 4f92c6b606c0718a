"""`stimuli bake recording`: from a person's video to a character's folder with a report on its quality."""

import base64
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path

import cv2
import numpy as np
from jinja2 import Environment, PackageLoader
from numpy.typing import NDArray
from PIL import Image as PillowImage

from experiments.errors import InputError, counted
from experiments.files import check_folder, whole_text
from stimuli_builder.characters.recording import (
    LOOKS_AWAY,
    SHEAR,
    EyeTrack,
    Opening,
    StillFrames,
    Values,
    align_opening,
    distinct_frames,
    find_openings,
    gaze_of,
    iris_scale,
    read_eye_track,
    read_selected,
    region_of,
)
from stimuli_builder.characters.recording_levels import (
    GOOD_DB,
    NEAR,
    TOLERANCE_MM,
    BuiltLevel,
    MeasuredLevels,
    build_levels,
    measure_levels,
    moving_crop,
    near_both_sides,
    rebuilt_frame,
    tracked_openings,
    without_strangers,
    write_recorded_character,
)
from stimuli_builder.characters.recording_lids import frames_by_motion, moved_levels
from stimuli_builder.progress import frame_progress, step_progress
from stimuli_builder.tracking.labelfree import TRAINED_ON, label_free_lesson, most_varied
from stimuli_builder.tracking.learn import open_video, training_steps
from stimuli_builder.tracking.model import CoupledModel, TrainingOptions, train
from stimuli_builder.tracking.shapes import CANTHI, EYE_POINTS, Points, default_markers, eye_axis
from stimuli_builder.tracking.survey import survey
from stimuli_builder.tracking.track import track_video
from stimuli_builder.video import Picture, VideoInfo, grey, read_frames, rgb

TRACK_NAME, REPORT_NAME = "track.csv", "report.html"
FISSURE_MM = 30.0
"""Width of an eye where no iris is seen to give the scale."""
EARLIER_S = 0.12
"""Without labels an eye may be shut so long before its last frame that is tracked as shut."""
LATER_S, STAYS_OPEN = 0.1, 0.03
"""Without labels an eye may go on opening so long after the frame that is tracked as open, while the tracked
closure stays within this of it."""
GAZES_LOOKED_AT = 12
CHECKED_FRAMES = 40
LEAST_LIKENESS = 0.5
"""Correlation of the tracked opening with what the eyes' pixels show; other videos have about 0."""


@dataclass(frozen=True)
class RecordingOrder:
    """One call of `stimuli bake recording`; the fields are its options."""

    video: Path
    out: Path
    track: Path | None = None
    one_eye: bool = False
    eye_distance_mm: float = 60.0
    label: str = ""
    accept_variable_rate: bool = False


@dataclass(frozen=True, eq=False)
class RecordingBake:
    """What came of a bake.

    Attributes
    ----------
    blinks, usable : int
        Found in the recording, and those a character could be made of.
    dropped : int
        Frames that did not fit their neighbors.
    left_out : float64 array (n,)
        dB of each recorded frame built from its neighbors; NaN at both ends.
    labeled : bool
        The tracker measured the openings, by a given track; else the motion of the lids did.
    limits : list of str
        What the result cannot do, and what to record again.
    """

    info: VideoInfo
    frames: StillFrames
    levels: list[BuiltLevel]
    measured: MeasuredLevels
    crop: tuple[int, int, int, int]
    px_per_mm: float
    opening_mm: float
    blinks: int
    usable: int
    dropped: int
    left_out: Values
    labeled: bool
    limits: list[str]

    @property
    def eyes(self) -> int:
        """One or two."""
        return int(self.frames.points.shape[1]) // EYE_POINTS

    @property
    def opening_error(self) -> str:
        """How far openings are off, in words."""
        if self.labeled:
            return f"opening within {self.measured.worst_mm:.2f} mm by the tracker"
        # The lids' own drift is much smaller, and would be taken for the error.
        return f"opening up to {UNLABELED_MM[self.eyes]:g} mm off, as measured without labels"


def bake_recording(order: RecordingOrder) -> RecordingBake:
    """Make a character of a recording and write its folder and report.

    Raises
    ------
    InputError
        The video or track cannot be used, or shows no blink of which a character could be made.
    """
    # Before anything is tracked: the work takes minutes, and a character may belong to a study.
    if (order.out / "character.toml").exists():
        raise InputError(f"{order.out}: there is a character already; choose another folder or remove it")
    info = open_video(order.video, order.accept_variable_rate)
    check_folder(order.out)
    path = order.track or _tracked(order, info)
    track = read_eye_track(path, info, order.one_eye)
    openings, refused = find_openings(track, info)
    opening, looks = _choose(order, info, track, openings, refused)
    video_px_per_mm = _scale(order, track, looks, opening)
    baked = _bake(order, info, track, opening, video_px_per_mm, len(openings), sum(refused.values()))
    provenance: dict[str, object] = {
        "command": "stimuli bake recording",
        "recording": order.video.name,
        "recorded_fps": round(info.fps, 3),
        "recorded_frames": len(baked.frames.numbers),
        "interpolated_levels": sum(level.first != level.second for level in baked.levels),
        "limits": list(baked.limits),
    }
    scale = (baked.px_per_mm, order.eye_distance_mm, baked.opening_mm)
    label = order.label or f"Recorded character {order.out.name}"
    write_recorded_character(
        order.out, label, baked.frames, baked.levels, baked.measured, baked.crop, scale, provenance
    )
    write_report(baked, order)
    return baked


def _tracked(order: RecordingOrder, info: VideoInfo) -> Path:
    """The track, made without labels in the character's folder."""
    with frame_progress() as progress:
        task = progress.add_task("finding eyes", total=info.frame_count)
        seen = survey(info, one_eye=order.one_eye, advance=lambda now: progress.update(task, completed=now))
    with step_progress("training", training_steps()) as advance:
        lesson = label_free_lesson(info, seen, TrainingOptions(), one_eye=order.one_eye, advance=advance)
    # The track stays with the character: a second bake need not track again.
    order.out.mkdir(parents=True, exist_ok=True)
    path = order.out / TRACK_NAME
    with frame_progress() as progress:
        task = progress.add_task("tracking", total=info.frame_count)
        track_video(
            lesson.model, info, path, lambda now: progress.update(task, completed=now.frames), seen.hints
        )
    return path


def _model_of(info: VideoInfo, track: EyeTrack) -> CoupledModel:
    """The tracker's model, learned again from a given track."""
    tracked = np.flatnonzero(np.isfinite(track.points).all((1, 2)))
    # Looking for varied shapes among all frames of five minutes would take longer than training.
    shapes = {int(n): track.points[n] for n in tracked[:: max(1, len(tracked) // 4000)]}
    chosen = {n: shapes[n] for n in most_varied(shapes, TRAINED_ON)}
    pictures = read_frames(info, list(chosen))
    return train(
        [pictures[n] for n in chosen],
        np.array(list(chosen.values())),
        default_markers(track.eyes),
        TrainingOptions(),
    )


def _choose(
    order: RecordingOrder, info: VideoInfo, track: EyeTrack, openings: list[Opening], refused: Counter[str]
) -> tuple[Opening, dict[int, Picture]]:
    """The densest opening after which the eyes do not look away, and gray pictures of some frames."""
    if not openings:
        reasons = "; ".join(f"{reason} ({number})" for reason, number in refused.most_common(3))
        raise InputError(
            f"{info.path}: no blink can be used{': ' + reasons if reasons else ', none was found'}; "
            "record again (docs/how-to/record-a-character.md)"
        )
    # Openings are sorted by how many frames they have; the first that fits is taken.
    looked_at = openings[:GAZES_LOOKED_AT]
    checked = _frames_to_check(track)
    # One pass through the video reads all of them.
    looks = sorted({*(opening.opened for opening in looked_at), *checked})
    with frame_progress() as progress:
        task = progress.add_task("looking at the eyes", total=info.frame_count)
        pictures = read_selected(info, looks, grey, lambda now: progress.update(task, completed=now))
    require_own_video(track, {n: pictures[n] for n in checked}, str(order.track or info.path))
    gazes = {opening: gaze_of(pictures[opening.opened], track, opening.opened) for opening in looked_at}
    seen = [gaze for gaze in gazes.values() if gaze is not None]
    for opening, gaze in gazes.items():
        if gaze is None or abs(gaze[0]) <= LOOKS_AWAY:
            return opening, pictures
    # Only if every opening looks away; the message names the median.
    usual = np.median(seen, axis=0)
    raise InputError(
        f"{info.path}: the eyes look to the side at every usable blink (irises {abs(usual[0]):.0%} of the "
        "eye's width from its middle); look into the camera"
    )


def _frames_to_check(track: EyeTrack) -> list[int]:
    """Shut frames, and as many open ones spread over the recording."""
    closure = track.closures.mean(1)
    # The ends of the range: of half-shut eyes the pictures differ too little.
    shut, opened = np.flatnonzero(closure > 0.8), np.flatnonzero(closure < 0.2)
    half = CHECKED_FRAMES // 2
    picks = [some[np.linspace(0, len(some) - 1, min(half, len(some))).astype(int)] for some in (shut, opened)]
    return sorted({int(n) for n in np.concatenate(picks)})


def require_own_video(track: EyeTrack, pictures: Mapping[int, Picture], name: str) -> None:
    """Refuse a track whose openings do not go with what the eyes of the video show.

    Parameters
    ----------
    pictures : mapping of int to uint8 array (h, w)
        Gray pictures of some shut and some open frames.

    Raises
    ------
    InputError
    """
    looks, openings = [], []
    for number, picture in pictures.items():
        patches = [_eye_patch(picture, eye) for eye in track.eye_points(number)]
        looks.append(np.concatenate(patches))
        openings.append(float(1 - track.closures[number].mean()))
    likeness = _left_out_likeness(np.array(looks), np.array(openings))
    if likeness < LEAST_LIKENESS:
        raise InputError(
            f"{name}: the tracked openings do not agree with the pictures (correlation {likeness:.2f}); use "
            "the track of this video"
        )


def _eye_patch(picture: Picture, eye: Points) -> Values:
    """An eye's 24 x 16 pixels, freed of place, size, turn and light."""
    along, down, width = eye_axis(eye)
    # A third of a width above the middle, as the patch is two thirds high.
    corner = (eye[CANTHI[0]] + eye[CANTHI[1]]) / 2 - along * width / 2 - down * width / 3
    matrix = np.column_stack([along * width / 24, down * width / 24, corner])
    patch = cv2.warpAffine(
        picture,
        matrix,
        (24, 16),
        flags=cv2.INTER_AREA | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    ).astype(np.float64)
    # A flat patch has no contrast to divide by.
    return np.asarray((patch - patch.mean()).ravel() / max(float(patch.std()), 1.0))


def _left_out_likeness(looks: Values, openings: Values) -> float:
    """Correlation of openings with the projection on open minus shut, each frame left out of the template."""
    opened = openings > 0.5
    scores = []
    for k, look in enumerate(looks):
        keep = np.arange(len(looks)) != k
        # With the frame itself in the template every track would seem to fit.
        scores.append(float(look @ (looks[keep & opened].mean(0) - looks[keep & ~opened].mean(0))))
    return float(np.corrcoef(scores, openings)[0, 1])


def _bake(
    order: RecordingOrder,
    info: VideoInfo,
    track: EyeTrack,
    opening: Opening,
    video_px_per_mm: float,
    usable: int,
    refused: int,
) -> RecordingBake:
    """Everything from the chosen opening to measured levels."""
    shut = opening.shut
    if order.track is None:
        earlier = _earlier(track, shut, round(EARLIER_S * info.fps))
        later = _later(track, opening.opened, round(LATER_S * info.fps))
        opening = replace(opening, shut=earlier, opened=later)
    with frame_progress() as progress:
        task = progress.add_task("reading the blink", total=opening.opened + 1)
        pictures = read_selected(
            info, list(opening.frames), rgb, lambda now: progress.update(task, completed=now)
        )
    # The region may be scaled down; openings in mm are measured in the video.
    region = region_of(track.points[opening.opened], info, video_px_per_mm)
    px_per_mm = video_px_per_mm * region.scale
    with step_progress("removing head motion", len(opening.frames) - 1) as advance:
        frames = align_opening(pictures, track, opening, info, region, px_per_mm, advance)
    motion = None
    if order.track is None:
        motion = frames_by_motion(frames, opening.opened - shut, px_per_mm)
    frames = distinct_frames(frames, frames.closures) if motion is None else motion.frames
    crop = moving_crop(frames.points[0], region.size_px)
    with step_progress("leaving frames out", len(frames.numbers) - 2) as advance:
        # Reflections, passing shadows and errors of compression make a frame a stranger among its neighbors.
        frames, left_out, dropped = without_strangers(frames, crop, advance)
    with step_progress("filling in levels", len(frames.numbers)) as advance:
        levels = build_levels(frames, crop, advance)
    if motion is None:
        model = _model_of(info, track)
        gray = read_frames(info, [opening.opened])[opening.opened]
        with step_progress("measuring openings", len(levels)) as advance:
            seen = tracked_openings(model, frames, levels, crop, gray, advance)
        measured = measure_levels(levels, seen, video_px_per_mm)
    else:
        measured = moved_levels(motion, levels, px_per_mm)
    # What is tracked of the shut eye is not part of it; see the limits.
    opening_mm = measured.opening_px / video_px_per_mm
    if not np.isfinite(opening_mm) or opening_mm <= 0:
        raise InputError(
            f"{info.path}: the tracker does not find the eyes in the levels; label frames by hand"
        )
    baked = RecordingBake(
        info,
        frames,
        levels,
        measured,
        crop,
        px_per_mm,
        opening_mm,
        usable + refused,
        usable,
        dropped,
        left_out,
        motion is None,
        [],
    )
    # Limits are judged on the finished bake, which is therefore made first.
    baked.limits.extend(limits_of(baked, track))
    return baked


def _earlier(track: EyeTrack, shut: int, most: int) -> int:
    """The first of up to so many frames before the shut one in which the eyes are not lost."""
    first = max(0, shut - most)
    lost = np.flatnonzero(np.isnan(track.points[first:shut]).any((1, 2)))
    return first + int(lost[-1]) + 1 if len(lost) else first


def _later(track: EyeTrack, opened: int, most: int) -> int:
    """The last of up to so many frames after the open one in which the eyes stay as open."""
    closure = track.closures.mean(1)[opened : opened + most + 1]
    # Where the eyes are lost the comparison is false, too.
    ends = np.flatnonzero(~(closure <= closure[0] + STAYS_OPEN))
    return opened + (int(ends[0]) if len(ends) else len(closure)) - 1


def _scale(
    order: RecordingOrder, track: EyeTrack, pictures: Mapping[int, Picture], opening: Opening
) -> float:
    """Pixels of the video per mm: by the distance between the eyes, or by the iris of one."""
    eyes = track.eye_points(opening.opened)
    if track.eyes == 2:
        return float(np.hypot(*(eyes[1].mean(0) - eyes[0].mean(0)))) / order.eye_distance_mm
    # Irises vary least between people (11.7 mm, SD 0.5); the width of an eye is the second best.
    return iris_scale(pictures, track) or track.width_px / FISSURE_MM


# Limits: what the recording did not give, and what to record again.

SLOW_FPS = 100
WIDE_GAP = 0.1
HEAD_MM = 3.0
LIGHT_CHANGE = 0.06
FLOOR_SHARE = 0.12
ROUGH_DB = 33.0
REFLECTION_MM2 = 0.3
BRIGHT_CODE = 235
SMALL_EYE_PX = 150
UNLABELED_MM, UNLABELED_OPEN_MM = {1: 0.4, 2: 0.3}, {1: 0.9, 2: 0.5}
"""Largest errors of openings without labels, and of the widest one, by the number of eyes
(docs/explanation/tracking-accuracy.md)."""


def limits_of(baked: RecordingBake, track: EyeTrack) -> Iterator[str]:
    """One sentence per limit, with what to record again."""
    frames = baked.frames
    if baked.usable == 1:
        yield "Only one blink could be used, so there was no choice. Record at least ten full blinks."
    if baked.info.fps < SLOW_FPS:
        yield f"At {baked.info.fps:.0f} frames per second most levels are interpolated. Record at 240."
    steps = np.diff(frames.closures)
    # Optical flow over a wider step shows two pale lids instead of one.
    for k in np.flatnonzero(steps > WIDE_GAP):
        low, high = frames.closures[k : k + 2]
        yield (
            f"No frame was recorded between closures {low:.2f} and {high:.2f}: levels there are "
            "interpolated. Record more frames per second, or close the eyes slowly."
        )
    near = near_both_sides(frames.closures)
    if near.any() and np.nanmin(baked.left_out[near]) < GOOD_DB:
        yield (
            f"A left-out frame comes back with {np.nanmin(baked.left_out[near]):.1f} dB although its "
            "neighbors are near. Record in steady light, and sit still."
        )
    yield from _limits_of_recording(baked, track)


def _limits_of_recording(baked: RecordingBake, track: EyeTrack) -> Iterator[str]:
    frames = baked.frames
    if not baked.labeled:
        yield (
            "Openings were measured without labels. In recordings of known truth they were up to "
            f"{UNLABELED_MM[baked.eyes]:g} mm off, and the widest opening up to "
            f"{UNLABELED_OPEN_MM[baked.eyes]:g} mm. For more, give a track from labels of your own "
            "(docs/how-to/label-frames.md)."
        )
    elif (floor := float((track.shut_px / track.open_px).max())) > FLOOR_SHARE:
        yield (
            f"In shut eyes the tracker measures {floor:.0%} of the open eye's opening. Openings in this "
            "report count from there, so they do not say how far the eyes really shut. Label some shut "
            "frames (docs/how-to/label-frames.md), and give the track."
        )
    if (moved := float(frames.head_mm.max())) > HEAD_MM:
        yield f"The head moved by {moved:.1f} mm during the blink. Rest the head against a wall or chin rest."
    if (change := float(np.ptp(frames.light))) > LIGHT_CHANGE:
        yield (
            f"The light changed by {change:.0%} during the blink. Use daylight or steady lamps; lock the "
            "exposure."
        )
    if (sheared := frames.shear) > SHEAR:
        yield (
            f"The picture is sheared by up to {sheared:.1%} as the head moves (rolling shutter). Keep the "
            "head still."
        )
    if (worst := float(frames.still_db.min())) < ROUGH_DB:
        yield (
            f"The skin around the eyes differs by {worst:.0f} dB from frame to frame. Keep hair, hands and "
            "shadows out of the picture."
        )
    if (area := reflection_mm2(baked)) > REFLECTION_MM2:
        yield (
            f"A reflection of {area:.1f} mm² stays in front of the shut eye, as on glasses. Take "
            "glasses off, or move the lamp."
        )
    if track.width_px * frames.region.scale < SMALL_EYE_PX:
        yield (
            f"The eyes are {track.width_px:.0f} pixels wide, so lashes are not sharp. Come nearer to "
            "the camera."
        )
    if lost := int(np.isnan(baked.measured.off_mm).sum()):
        yield f"The tracker does not find the eyes in {lost} levels. Label frames by hand."
    off = baked.measured.worst_mm
    if off > TOLERANCE_MM:
        yield (
            f"The tracked opening of a level differs by {off:.2f} mm from its closure. Label frames by hand."
            if baked.labeled
            else f"Followed from shut to open and back, the lids are {2 * off:.2f} mm from where they began. "
            "Label frames by hand."
        )


def reflection_mm2(baked: RecordingBake) -> float:
    """Area within the eye openings that is bright in every frame, whatever the lids do."""
    # The darkest of all frames: lids, lashes and iris pass, a reflection on glass stays.
    darkest = np.min([picture.min(2) for picture in baked.frames.pictures], axis=0)
    inside = np.zeros(darkest.shape, np.uint8)
    for eye in baked.frames.points[0].reshape(-1, EYE_POINTS, 2):
        cv2.fillPoly(inside, [eye.round().astype(np.int32)], 1)
    return float(((darkest > BRIGHT_CODE) & (inside > 0)).sum()) / baked.px_per_mm**2


# The report: one page, its pictures within it.

SHEET_CLOSURES = 16
SHOWN_WORST = 3


def write_report(baked: RecordingBake, order: RecordingOrder) -> Path:
    """Write `report.html` into the character's folder."""
    environment = Environment(
        loader=PackageLoader("stimuli_builder.characters", "templates"), autoescape=True
    )
    page = environment.get_template("recording.html.j2").render(
        name=order.out.name,
        baked=baked,
        rows=list(closure_rows(baked)),
        sheet=_embedded(closure_sheet(baked)),
        worst=[(number, closure, value, _embedded(strip)) for number, closure, value, strip in _worst(baked)],
        plot=left_out_plot(baked),
        opening_off=baked.measured.worst_mm,
        near=NEAR,
        good=GOOD_DB,
    )
    path = order.out / REPORT_NAME
    with whole_text(path) as stream:
        stream.write(page)
    return path


@dataclass(frozen=True)
class ClosureRow:
    """One line of the report's table: what the picture at a closure is made of, and how well."""

    closure: float
    origin: str
    gap: float
    left_out_db: float
    off_mm: float


def closure_rows(baked: RecordingBake) -> Iterator[ClosureRow]:
    """The level next to each twentieth of closure."""
    closures = baked.measured.closures
    for closure in np.linspace(0, 1, 21):
        k = int(np.argmin(np.abs(closures - closure)))
        level = baked.levels[k]
        numbers = baked.frames.numbers
        gap = float(baked.frames.closures[level.second] - baked.frames.closures[level.first])
        origin = f"frame {numbers[level.first]}"
        if level.first != level.second:
            origin = f"interpolated, frames {numbers[level.first]} and {numbers[level.second]}"
        # A level is as good as the worse of the two frames it is made of.
        around = baked.left_out[[level.first, level.second]]
        known = around[np.isfinite(around)]
        value = float(known.min()) if len(known) else float("nan")
        yield ClosureRow(float(closure), origin, gap, value, float(baked.measured.off_mm[k]))


def closure_sheet(baked: RecordingBake) -> NDArray[np.uint8]:
    """The crop at 16 closures from open to shut, four in a row."""
    chosen = [
        int(np.argmin(np.abs(baked.measured.closures - one))) for one in np.linspace(0, 1, SHEET_CLOSURES)
    ]
    crops = [baked.levels[k].crop for k in chosen]
    rows = [np.hstack(crops[k : k + 4]) for k in range(0, SHEET_CLOSURES, 4)]
    return np.vstack(rows)


def _worst(baked: RecordingBake) -> Iterator[tuple[int, float, float, NDArray[np.uint8]]]:
    """The frames that come back worst: recorded, rebuilt, and their difference four times."""
    known = np.flatnonzero(np.isfinite(baked.left_out))
    for k in known[np.argsort(baked.left_out[known])][:SHOWN_WORST]:
        rebuilt, recorded = rebuilt_frame(baked.frames, int(k), baked.crop)
        # Differences are enlarged four times around middle gray, or nobody would see them.
        parts = (recorded, rebuilt, 128 + 4 * (rebuilt - recorded))
        strip = np.hstack([np.clip(np.rint(part), 0, 255).astype(np.uint8) for part in parts])
        yield baked.frames.numbers[k], float(baked.frames.closures[k]), float(baked.left_out[k]), strip


def _embedded(picture: NDArray[np.uint8]) -> str:
    """A picture as the source of an <img>."""
    stored = BytesIO()
    PillowImage.fromarray(picture).save(stored, "WEBP", quality=85)
    return "data:image/webp;base64," + base64.b64encode(stored.getvalue()).decode()


def left_out_plot(baked: RecordingBake) -> str:
    """SVG: dB of left-out frames over closure, and a tick for every recorded frame."""
    width, height, low, high = 720, 240, 20.0, 50.0

    def x(closure: float) -> float:
        return 50 + closure * (width - 70)

    def y(value: float) -> float:
        return height - 40 - (min(max(value, low), high) - low) / (high - low) * (height - 60)

    parts = [
        f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="Left-out frames in dB over closure">'
    ]
    for value in (20, 30, GOOD_DB, 50):
        parts.append(
            f'<line x1="50" x2="{width - 20}" y1="{y(value):.1f}" y2="{y(value):.1f}" class="grid"/>'
        )
        parts.append(f'<text x="8" y="{y(value) + 4:.1f}">{value:g} dB</text>')
    for closure, value in zip(baked.frames.closures, baked.left_out, strict=True):
        across = f'x1="{x(closure):.1f}" x2="{x(closure):.1f}"'
        parts.append(f'<line {across} y1="{height - 36}" y2="{height - 28}" class="tick"/>')
        if np.isfinite(value):
            parts.append(f'<circle cx="{x(closure):.1f}" cy="{y(float(value)):.1f}" r="3.5"/>')
    for closure in (0, 0.25, 0.5, 0.75, 1):
        parts.append(f'<text x="{x(closure):.0f}" y="{height - 10}" text-anchor="middle">{closure:g}</text>')
    return "".join([*parts, "</svg>"])


def summary_lines(baked: RecordingBake, order: RecordingOrder) -> Sequence[str]:
    """What the command prints."""
    between = sum(level.first != level.second for level in baked.levels)
    known = baked.left_out[np.isfinite(baked.left_out)]
    near = near_both_sides(baked.frames.closures)
    least = (
        f", at least {np.nanmin(baked.left_out[near]):.1f} dB where neighbors are near" if near.any() else ""
    )
    return [
        f"{order.out}: {len(baked.levels)} levels, {len(baked.frames.numbers)} of them recorded and "
        f"{between} interpolated; {counted(baked.usable, 'usable blink')} of {baked.blinks}",
        f"left-out frames: median {np.median(known):.1f} dB{least}; {baked.opening_error}",
        *(f"limit: {limit}" for limit in baked.limits),
        f"{order.out / REPORT_NAME}: what is recorded, what is interpolated and how well",
    ]
