"""Speed and accuracy of the tracker against the targets of design/tracking.md: prints one table.

    python tests/bench/bench_tracking.py [seconds of actor, default 20]

Fit only is processor time of one core; end to end is wall-clock time with decoding on its own thread. The
peer is the direct form of the same step in numpy: steepest-descent images, Hessian and right side by pixels.
"""

import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from stimuli_builder.actor.recording import Actor, ActorOptions, label_points, write_truth, write_video
from stimuli_builder.tracking.accuracy import compare_with_truth
from stimuli_builder.tracking.fit import Fitter, linear_parts, work_out
from stimuli_builder.tracking.labels import Labels, save_labels
from stimuli_builder.tracking.learn import learn
from stimuli_builder.tracking.mesh import reduced
from stimuli_builder.tracking.model import CoupledModel, TrainingOptions, warped
from stimuli_builder.tracking.shapes import default_markers
from stimuli_builder.tracking.track import track_video
from stimuli_builder.video import frames, read_frames, scan_video


def print_line(name: str, value: str, must: str = "", aim: str = "") -> None:
    sys.stdout.write(f"{name:<52} {value:>14} {must:>10} {aim:>10}\n")


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
    small = reduced(picture, model.reduction)
    fitter = Fitter(model, stop_px=0.0)
    c, pose = model.examples[0], model.poses[0]
    ours = best_of(40, 7, lambda: fitter.fit(small, c, pose, max_iterations=10)) / 10
    algebra, (gx, gy) = work_out(model), model.mesh.gradient(model.appearance.astype(np.float64))
    parts = linear_parts(model, gx, gy, algebra.directions).astype(np.float32)
    weights = np.r_[1.0, c].astype(np.float32)
    vertices = fitter.fit(small, c, pose, max_iterations=1).vertices.astype(np.float64)

    def direct() -> None:
        descent = np.tensordot(weights, parts, axes=1)
        error = model.weights * (weights @ model.appearance - warped(model.mesh, small, vertices))
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
        print_line(name + "re-initialised / lost", f"{report.reinitialised} / {report.lost}", "0", "0")


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 20.0
    print_line(f"tracker, {seconds:g} s of actor at 300 frames/s", "measured", "must", "aim")
    with tempfile.TemporaryDirectory() as folder:
        actor_tables(seconds, Path(folder))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print_line("most memory, MB (drawing included)", f"{peak:.0f}", "500")


if __name__ == "__main__":
    main()
