"""How exact the blink labels are, how fast, and how well curves of few numbers follow recorded blinks.

Part of `make bench`; alone: python -m pytest bench/bench_blinks.py -o python_files='bench_*.py' -s

Blink labels of tracked video against the synthetic actor's plan: the table of docs/explanation/tracking.md.

    python -m bench.bench_blinks [seconds of actor per seed, default 90] [folder that keeps the drawings]

Seeds 2, 3 and 4 are drawn, tracked with 20 exactly labeled frames and labeled, both eyes. Truth: 5% of the
amplitude, apex and 95% recovery of the plan, in fractions of a frame at 300 frames/s. Every blink of the plan
is at least 30% deep.
"""

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from bench.harness import print_line, say
from stimuli_builder.actor.recording import (
    Actor,
    ActorOptions,
    Blink,
    course,
    label_points,
    plan_blinks,
    write_video,
)
from stimuli_builder.blinks.blink_model import TEXTBOOK_KINDS, BlinkModel, textbook_profile
from stimuli_builder.blinks.labelling import PRESETS, LabelledBlink, LabelOptions, label_blinks
from stimuli_builder.blinks.library import load_library
from stimuli_builder.blinks.profile import Array, BlinkProfile, resample_phases
from stimuli_builder.blinks.series import BlinkSeries, read_series
from stimuli_builder.tracking.labels import Labels, save_labels
from stimuli_builder.tracking.learn import learn
from stimuli_builder.tracking.model import TrainingOptions
from stimuli_builder.tracking.shapes import default_markers
from stimuli_builder.tracking.track import track_video
from stimuli_builder.video import scan_video

FPS = 300
OPENING_PX = 34.0


def recording(noise_px: float, seed: int, seconds: int = 1333) -> tuple[list[Blink], Array]:
    """Blinks of the synthetic actor and the distance of one eye, 400,000 frames."""
    plan = plan_blinks(seconds, np.random.default_rng([seed, 4]))
    closure = course(np.arange(FPS * seconds) / FPS, plan, seed).closure[:, 0]
    jitter = np.random.default_rng(seed).normal(0, noise_px, closure.size)
    return plan, np.maximum(OPENING_PX * (1 - closure) + jitter, 0)


def matches(plan: Sequence[Blink], detected: Sequence[LabelledBlink]) -> list[tuple[float, float, float]]:
    """Errors of onset, minimum and end, in frames, of each blink found once."""
    apexes = np.array([blink.apex_s * FPS for blink in plan])
    taken: dict[int, tuple[float, float, float]] = {}
    for blink in detected:
        nearest = int(np.argmin(np.abs(apexes - blink.minimum)))
        truth = plan[nearest]
        if abs(apexes[nearest] - blink.minimum) < 20 and nearest not in taken:
            onset, end = (truth.apex_s - truth.down_s) * FPS, (truth.apex_s + truth.up_s) * FPS
            taken[nearest] = (blink.onset - onset, blink.minimum - apexes[nearest], blink.end - end)
    return list(taken.values())


def test_labels_against_the_synthetic_actor(benchmark):
    say("labels on the synthetic actor's course (truth: 5% of the amplitude, apex, 95% recovery)")
    say("noise px  precision  recall   |error| in frames of onset, apex, end: median | mean | 95%")
    for noise_px in (0.05, 0.15, 0.3):
        detected = true = 0
        errors: list[tuple[float, float, float]] = []
        for seed in (1, 2, 3, 4):
            plan, distance = recording(noise_px, seed)
            blinks = label_blinks(distance, FPS)
            errors += matches(plan, blinks)
            detected, true = detected + len(blinks), true + len(plan)
        size = np.abs(errors)
        rows = [np.median(size, axis=0), size.mean(axis=0), np.percentile(size, 95, axis=0)]
        spread = " | ".join(" ".join(f"{value:5.1f}" for value in row) for row in rows)
        say(f"{noise_px:8.2f} {len(errors) / detected:10.4f} {len(errors) / true:7.4f}   {spread}")
    _, distance = recording(0.15, 1)
    benchmark.pedantic(label_blinks, (distance, FPS), rounds=5)
    say(f"{distance.size / benchmark.stats.stats.median / 1e6:.1f} million frames a second\n")


def half_gaussians(profile: BlinkProfile) -> Array:
    """Best two half-Gaussians (the ESPBM's form: height, place, two widths) for a profile."""
    frames = np.arange(profile.closure.size)

    def curve(p: Array) -> Array:
        return p[0] * np.exp(-0.5 * ((frames - p[1]) / np.where(frames < p[1], p[2], p[3])) ** 2)

    start = [profile.closure.max(), profile.minimum_index, profile.down_frames / 2, profile.up_frames / 2]
    bounds = ([0, 0, 1, 1], [2, frames.size, 500, 500])
    return curve(least_squares(lambda p: curve(p) - profile.closure, start, bounds=bounds).x)


def rebuilt(training: list[BlinkProfile], profile: BlinkProfile) -> Array:
    """The profile through a model that has not seen it, at the profile's own phase lengths."""
    model = BlinkModel.fit(training)
    form, _, _ = model.normalised_forms(model.coefficients(profile))
    closure = np.clip(form[0], 0, 1)
    normal = BlinkProfile("x", closure, model.down_frames, model.down_frames, model.up_frames, 1.0, "model")
    return resample_phases(normal, profile.down_frames, profile.up_frames).closure


def test_forms_against_recorded_profiles(benchmark):
    """RMS of closure between recorded profiles and the curves that stand for them."""
    shipped = list(load_library())
    rows: dict[str, list[float]] = {}
    for index, profile in enumerate(shipped):
        peak = float(profile.closure.max())
        curves = {
            "model, 5 components, left out": rebuilt(shipped[:index] + shipped[index + 1 :], profile),
            "two half-Gaussians, fitted": half_gaussians(profile),
        }
        for kind in TEXTBOOK_KINDS:
            own = profile.down_fraction if kind.startswith("AL") else None
            made = textbook_profile(kind, profile.duration_frames_30fps, peak_closure=peak, down_fraction=own)
            curves[f"textbook {kind}, own length and peak"] = made.closure
        for name, curve in curves.items():
            rows.setdefault(name, []).append(float(np.sqrt(np.mean((curve - profile.closure) ** 2))))
    say(f"RMS of closure against the {len(shipped)} recorded profiles: median (worst)")
    for name, values in sorted(rows.items(), key=lambda row: float(np.median(row[1]))):
        say(f"  {name:38} {np.median(values):.3f} ({max(values):.3f})")

    benchmark.pedantic(BlinkModel.fit, (shipped,), rounds=5)


SEEDS = (2, 3, 4)
TARGETS = {"onset": ("5", "3"), "minimum": ("2", "1"), "end": ("15", "8")}

Eye = tuple[list[Blink], BlinkSeries]


def tracked(seconds: float, seed: int, folder: Path) -> list[Eye]:
    """The plan and the tracked distance of each eye; drawn and tracked where the folder has no such track."""
    plan = plan_blinks(seconds, np.random.default_rng([seed, 4]))
    name = f"actor-{seed}-{seconds:g}s"
    track = folder / f"{name}.track.csv"
    if not track.exists():
        actor, video = Actor(ActorOptions(seconds=seconds, seed=seed)), folder / f"{name}.mp4"
        if not video.exists():
            write_video(actor, video, lambda: None)
        info, labels = scan_video(video), folder / f"{name}.labels.json"
        exact = Labels(labels, info.size_px, default_markers(2), label_points(actor, 20, 0.0))
        save_labels(exact, video.name, "bench")
        track_video(learn(info, labels, TrainingOptions(), one_eye=False).model, info, track)
    return [(plan, series) for series in read_series(track)]


def tell(name: str, options: LabelOptions, eyes: list[Eye]) -> None:
    detected = [label_blinks(series.distance, series.fps, options) for _, series in eyes]
    errors = np.abs(
        [row for (plan, _), blinks in zip(eyes, detected, strict=True) for row in matches(plan, blinks)]
    )
    labelled, true = sum(len(blinks) for blinks in detected), sum(len(plan) for plan, _ in eyes)
    print_line(f"preset {name}", "")
    print_line("  precision", f"{len(errors) / labelled:.3f}", "0.98", "1.00")
    print_line("  recall", f"{len(errors) / true:.3f}", "0.98", "0.995")
    for column, (event, targets) in zip(errors.T, TARGETS.items(), strict=True):
        spread = (np.median(column), column.mean(), np.percentile(column, 95))
        line = " | ".join(f"{value:.1f}" for value in spread)
        print_line(f"  {event}, frames: median | mean | 95%", line, *targets)


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 90.0
    with tempfile.TemporaryDirectory() as bare:
        folder = Path(sys.argv[2]) if len(sys.argv) > 2 else Path(bare)
        folder.mkdir(parents=True, exist_ok=True)
        eyes = [eye for seed in SEEDS for eye in tracked(seconds, seed, folder)]
    print_line(
        f"blink labels, {len(SEEDS)} actors of {seconds:g} s, tracked video", "measured", "must", "aim"
    )
    print_line("blinks of the plan, both eyes", str(sum(len(plan) for plan, _ in eyes)))
    for name, options in PRESETS.items():
        tell(name, options, eyes)


if __name__ == "__main__":
    main()
