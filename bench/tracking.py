"""Speed and accuracy of the tracker against the targets of docs/explanation/tracking.md: prints one table.

    python -m bench.tracking actor [seconds of actor, default 20]
    python -m bench.tracking light

Fit only is processor time of one core; end to end is wall-clock time with decoding on its own thread. The
peer is the direct form of the same step in numpy: steepest-descent images, Hessian and right side by pixels.

light: two recordings of 300 frames made darker, brighter, flatter and unsteady, 20 exact labels each in
even light. Prints frames tracked and lost, the points' error, and frames off by more than 5% of the eye's
width.
"""

import resource
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from bench.harness import print_line, run_part
from stimuli_builder.actor.recording import Actor, ActorOptions, label_points, write_truth, write_video
from stimuli_builder.tracking.accuracy import compare_with_truth
from stimuli_builder.tracking.fit import Fitter, linear_parts, work_out
from stimuli_builder.tracking.labels import Labels, save_labels
from stimuli_builder.tracking.learn import learn
from stimuli_builder.tracking.mesh import reduce_picture
from stimuli_builder.tracking.model import CoupledModel, TrainingOptions, warp_picture
from stimuli_builder.tracking.shapes import Points, default_markers, widths
from stimuli_builder.tracking.track import track_video
from stimuli_builder.tracking.tracker import Tracker
from stimuli_builder.video import Picture, frames, read_frames, scan_video


def best_of(repeats: int, rounds: int, job) -> float:
    """Seconds of processor time of one call, the best of several rounds."""
    times = []
    for _ in range(rounds):
        before = time.thread_time()
        for _ in range(repeats):
            job()
        times.append((time.thread_time() - before) / repeats)
    return min(times)


def step_times(model: CoupledModel, picture: np.ndarray) -> tuple[float, float]:
    """Microseconds of one iteration: ours, and the direct form in numpy."""
    small = reduce_picture(picture, model.reduction)
    fitter = Fitter(model, stop_px=0.0)
    c, pose = model.examples[0], model.poses[0]
    ours = best_of(40, 7, lambda: fitter.fit(small, c, pose, max_iterations=10)) / 10
    algebra, (gx, gy) = work_out(model), model.mesh.gradient(model.appearance.astype(np.float64))
    parts = linear_parts(model, gx, gy, algebra.directions).astype(np.float32)
    weights = np.r_[1.0, c].astype(np.float32)
    vertices = fitter.fit(small, c, pose, max_iterations=1).vertices.astype(np.float64)

    def direct() -> None:
        descent = np.tensordot(weights, parts, axes=1)
        error = model.weights * (weights @ model.appearance - warp_picture(model.mesh, small, vertices))
        np.linalg.solve((descent * model.weights) @ descent.T + np.eye(len(descent)) * 1e-6, descent @ error)

    return 1e6 * ours, 1e6 * best_of(5, 5, direct)


def actor_tables(seconds: float, folder: Path) -> None:
    actor = Actor(ActorOptions(seconds=seconds, seed=1))
    video, truth = folder / "actor.mp4", folder / "truth.csv"
    write_video(actor, video, lambda: None)
    write_truth(actor, truth)
    info = scan_video(video)
    decoding = time.perf_counter()
    count = sum(1 for _ in frames(video))
    print_line("decoding alone, frames/s", f"{count / (time.perf_counter() - decoding):,.0f}")
    for noise, must, aim in ((0.0, "0.5", "0.15"), (1.0, "0.7", "0.3")):
        labels = folder / f"labels{noise:g}.json"
        points = label_points(actor, 20, noise)
        save_labels(Labels(labels, info.size_px, default_markers(2), points), video.name, "bench")
        lesson = learn(info, labels, TrainingOptions(), one_eye=False)
        summary = track_video(lesson.model, info, folder / "track.csv")
        report = compare_with_truth(folder / "track.csv", truth)
        name = f"label noise {noise:g} px: "
        if not noise:
            ours, direct = step_times(lesson.model, read_frames(info, [0])[0])
            print_line("one iteration, microseconds", f"{ours:.0f}")
            print_line("the same in numpy, microseconds (ratio)", f"{direct:.0f} ({direct / ours:.0f}x)")
            print_line("fit only, frames/s", f"{summary.fit_fps:,.0f}", "1,000", "5,000")
            print_line("end to end, frames/s", f"{summary.end_to_end_fps:,.0f}", "400", "1,000")
        print_line(name + "labels refined", str(lesson.refined))
        print_line(name + "landmark RMS, px", f"{report.rms_px:.3f}", must, aim)
        print_line(name + "95th percentile in blinks, px", f"{report.blink_p95_px or 0:.3f}", "1")
        print_line(name + "inter-eyelid distance sd, px", f"{report.distance_sd_px:.3f}", "0.3", "0.1")
        print_line(name + "re-initialized / lost", f"{report.reinitialised} / {report.lost}", "0", "0")


def measure_actor() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 20.0
    print_line(f"tracker, {seconds:g} s of actor at 300 frames/s", "measured", "must", "aim")
    with tempfile.TemporaryDirectory() as folder:
        actor_tables(seconds, Path(folder))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print_line("most memory, MB (drawing included)", f"{peak:.0f}", "500")


SEEDS = (11, 12)
CHANGES: dict[str, Callable[[int], tuple[float, float]]] = {
    "even light": lambda _: (1.0, 0.0),
    "fades to 60%": lambda n: (1 - 0.4 * n / 300, 0.0),
    "swings by 30%": lambda n: (1 + 0.3 * np.sin(n / 15), 0.0),
    "70% from a frame on": lambda n: (0.7 if n > 100 else 1.0, 0.0),
    "flickers by 8%": lambda n: (1 + 0.08 * np.sin(2.1 * n), 0.0),
    "luminance 16 to 235": lambda _: (219 / 255, 16.0),
    "70% of the contrast": lambda _: (0.7, 40.0),
    "a quarter brighter": lambda _: (1.25, 0.0),
}


def recorded(folder: Path, seed: int) -> tuple[list[Picture], Points, CoupledModel]:
    """Pictures, exact points (frames, 18, 2) and a model of one recording."""
    actor = Actor(ActorOptions(seconds=3.0, fps=100, seed=seed))
    video, truth, labels = (folder / f"{seed}{end}" for end in (".mp4", ".csv", ".json"))
    write_video(actor, video, lambda: None)
    write_truth(actor, truth)
    save_labels(
        Labels(labels, (512, 384), default_markers(2), label_points(actor, 20, 0.0)), video.name, "actor"
    )
    lesson = learn(scan_video(video), labels, TrainingOptions(), one_eye=False, refine=False)
    points = np.loadtxt(truth, delimiter=",", skiprows=1, usecols=range(2, 38)).reshape(-1, 18, 2)
    return list(frames(video)), points, lesson.model


def measure_light() -> None:
    with tempfile.TemporaryDirectory() as folder:
        recordings = [recorded(Path(folder), seed) for seed in SEEDS]
    for name, change in CHANGES.items():
        away, lost = [], 0
        for pictures, points, model in recordings:
            tracker = Tracker(model)
            for number, (picture, true) in enumerate(zip(pictures, points, strict=True)):
                gain, offset = change(number)
                changed = np.clip(np.rint(gain * picture.astype(np.float32) + offset), 0, 255)
                frame = tracker.step(changed.astype(np.uint8))
                lost += frame.points is None
                if frame.points is not None:
                    away.append((np.sqrt(((frame.points - true) ** 2).sum(1).mean()), widths(true)))
        far = np.array(away).reshape(-1, 2)
        sys.stdout.write(
            f"{name:20} {lost} of {lost + len(far)} lost, RMS {np.sqrt((far[:, 0] ** 2).mean()):.3f} px, "
            f"{int((far[:, 0] > 0.05 * far[:, 1]).sum())} more than 5% off\n"
        )


PARTS = {
    "actor": measure_actor,
    "light": measure_light,
}

if __name__ == "__main__":
    sys.exit(run_part(PARTS))
