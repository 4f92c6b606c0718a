"""Blinks distinguished from squints, gaze shifts and closed eyes: classifier, prominent peaks, the paper's
rule.

    python -m bench.lid_events compare [FOLDER]
    python -m bench.lid_events compare --seed 8001 --series 24 --rates 30,120,240    # no recordings
    python -m bench.lid_events errors [--seed 7001] [--series 40] [--rates 120,240]
    python -m bench.lid_events webcam FOLDER OUT

compare: prints precision, recall and F1 on generated series that trained nothing, at several rates, and how
many squints and closed eyes were called blinks: those held for 0.25 s or more, and brief ones. FOLDER,
where given, holds hand-labeled series: CSV files with the columns frame, ear and tag ('0' where no blink
is), 30 frames a second, as made from the eyeblink8 videos by `webcam`. Recordings of ../shared/data, where
there, are compared with a table made by others.

The peaks are in the style of JeFaPaTo: prominence 0.05 of an eye aspect ratio of 0.3, widths of 20 to 100 and
distances of 50 frames at 240 frames a second.

errors: what the classifier makes of the blinks that it misses, on generated series.
Blinks are matched as above, the first eye's. Each one missed is counted by what the
classifier lists with its deepest moment at the hold (a squint, a gaze shift, a closed eye, a blink that
another has taken, nothing) and by what the generator did: full or partial, on a gaze shift, next to another
blink (less than 0.1 s away), alone. `faint` counts those whose depth is below 0.2 or below five times the
noise of a frame. False blinks are counted by the event that they lie in.

webcam: hand-labeled webcam series, from a published evaluation on eyeblink8.
FOLDER is `original_svm` of github.com/QuangPham2404/Blink-Detection-Using-Adaptive-Eye-Aspect-Ratio (commit
3fd1191): `ear1.txt` to `ear8.txt` are the mean eye aspect ratio of both eyes by MediaPipe's face mesh with
refined lids, one line per frame of eyeblink8's eight videos; `zzz_target.txt` has one line per video, with 1
where eyeblink8's people labeled a blink. Writes one CSV per video: frame, ear, tag.

Some label lists lack frames that the series have (up to 90, in one or two places). The series itself shows
the place: labels are shifted by what makes the aspect ratio lowest within the labeled blinks, shifts never
decrease, and a change costs as much as 0.3 of an open eye. No classifier takes part.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.signal import find_peaks

from bench.harness import run_part
from bench.lid_event_training import GeneratedSeries, Motion, generate
from stimuli_builder.blinks.events.candidates import CLOSED_EYE_S, depth_of
from stimuli_builder.blinks.events.recognise import recognise
from stimuli_builder.blinks.events.rules import LidEvent
from stimuli_builder.blinks.labelling import label_blinks
from stimuli_builder.blinks.profile import Array
from stimuli_builder.blinks.series import BlinkSeries
from stimuli_builder.blinks.times import bridge_gaps, runs

SEED = 909
SERIES = 20
RATES = (15.0, 30.0, 60.0, 120.0, 500.0)
SLACK_S = 0.1
HELD_S = 0.25
"""A squint that stays for less is a partial blink in its course; it is counted apart."""
OTHERS = Path("../shared/data/blink_series")
FAST = 120.0
TOTALS: dict[str, Array] = {}
OF_FAST: dict[str, list[Array]] = {}
Method = Callable[[Sequence[Array], float], list[float]]


def classified(eyes: Sequence[Array], fps: float) -> list[float]:
    """Seconds of the first eye's blinks by the classifier."""
    seen = recognise([BlinkSeries(distance=eye, fps=fps, column="d", is_px=False) for eye in eyes])
    return [event.minimum_s for event in seen[0].events if event.kind == "blink"]


def peaks(eyes: Sequence[Array], fps: float) -> list[float]:
    """Seconds of prominent peaks of the first eye's series."""
    series = pd.Series(eyes[0]).interpolate(limit_direction="both").to_numpy()
    open_level = float(np.percentile(series, 85))
    detected, _ = find_peaks(
        -series,
        distance=max(1, 50 * fps / 240),
        prominence=0.05 / 0.3 * open_level,
        width=(20 * fps / 240, 100 * fps / 240),
    )
    return (detected / fps).tolist()


def papers(eyes: Sequence[Array], fps: float) -> list[float]:
    """Seconds of the minima that the paper's rule labels, preset 'velocity'."""
    return [blink.minimum / fps for blink in label_blinks(eyes[0], fps, is_px=False)]


METHODS: dict[str, Method] = {"classifier": classified, "prominent peaks": peaks, "paper's rule": papers}


def matched(times: Sequence[float], spans: Sequence[tuple[float, float]]) -> list[float | None]:
    """For each span the first time in it that no other has, in seconds; None where there is none."""
    free, taken = sorted(times), list[float | None]()
    for start, end in spans:
        inside = next((time for time in free if start - SLACK_S <= time <= end + SLACK_S), None)
        if inside is not None:
            free.remove(inside)
        taken.append(inside)
    return taken


def counts(detected: Sequence[float], true: Sequence[tuple[float, float]]) -> Array:
    """Hits, false alarms and misses; each blink is matched once."""
    hits = sum(time is not None for time in matched(detected, true))
    return np.array([hits, len(detected) - hits, len(true) - hits], float)


def say_counts(name: str, total: Array, more: str = "") -> None:
    hits, alarms, misses = total
    precision, recall = hits / max(hits + alarms, 1), hits / max(hits + misses, 1)
    line = f"  {name:16} precision {precision:.3f}  recall {recall:.3f}  F1 {f1(total):.3f}"
    sys.stdout.write(f"{line}  ({hits:.0f} hits, {alarms:.0f} false, {misses:.0f} missed){more}\n")


def compare_generated(fps: float, seed: int, count: int) -> None:
    sys.stdout.write(f"generated series, {fps:g} frames/s\n")
    series = [generate(np.random.default_rng([seed, n, int(fps)]), 40, fps) for n in range(count)]
    for name, method in METHODS.items():
        totals, called, shut = [], np.zeros(2, int), np.zeros(2, int)
        for one in series:
            detected = method(one.distances, fps)
            totals.append(counts(detected, [(m.onset_s, m.end_s) for m in one.motions if m.kind == "blink"]))
            for m in one.motions:
                if m.kind in ("squint", "closed_eye"):
                    brief = int(m.hold_s < HELD_S)
                    shut[brief] += 1
                    called[brief] += any(m.onset_s <= time <= m.end_s for time in detected)
        TOTALS[name] = TOTALS.get(name, 0) + np.array([*called, *shut])
        if fps >= FAST:
            OF_FAST.setdefault(name, []).extend(totals)
        say_counts(
            name,
            np.sum(totals, axis=0),
            f", called blinks: {called[0]} of {shut[0]} held, {called[1]} of {shut[1]} brief",
        )


def compare_recorded(folder: Path) -> None:
    files = sorted(folder.glob("*.csv"))
    sys.stdout.write(f"{len(files)} hand-labeled series, 30 frames/s, one column, {folder}\n")
    series = [hand_labelled(file) for file in files]
    for name, method in METHODS.items():
        as_labelled, as_defined = [], []
        for ear, blinks, closed in series:
            detected = method([ear], 30.0)
            as_labelled.append(counts(detected, blinks + closed))
            elsewhere = [t for t in detected if not any(a - SLACK_S <= t <= b + SLACK_S for a, b in closed)]
            as_defined.append(counts(elsewhere, blinks))
        say_counts(
            name,
            np.sum(as_labelled, axis=0),
            f", standard error over recordings {jackknife(as_labelled):.3f}",
        )
        say_counts("  no closed eyes", np.sum(as_defined, axis=0))


def measured_by_others() -> None:
    """Recordings of 240 frames/s against the table of JeFaPaTo's authors, each eye for itself."""
    table = OTHERS / "blinking_full_blinking.xlsx"
    if not table.exists():
        sys.stdout.write(f"{table}: not there, left out\n")
        return
    sys.stdout.write("two extractions of one recording, 240 frames/s, against JeFaPaTo's table\n")
    apexes = {side: pd.read_excel(table, f"blinking {side} eye")["apex_frame"] for side in ("left", "right")}
    for name, method in METHODS.items():
        totals = []
        for file, start in (("blinking_short.csv", "EAR2D6_"), ("espbm_sample_ear_short.csv", "EAR_")):
            series = pd.read_csv(OTHERS / file)
            eyes = {side: series[start + side[0]].to_numpy(np.float64) for side in apexes}
            for side, other in (("left", "right"), ("right", "left")):
                seen = apexes[side][apexes[side] < len(series)] / 240
                detected = method([eyes[side], eyes[other]], 240.0)
                totals.append(counts(detected, [(time, time) for time in seen]))
        say_counts(name, np.sum(totals, axis=0))


def hand_labelled(file: Path) -> tuple[Array, list[tuple[float, float]], list[tuple[float, float]]]:
    """Eye aspect ratio, the labeled blinks, and those shut for half a second: closed eyes."""
    table = pd.read_csv(file, dtype={"tag": str})
    ear = pd.to_numeric(table["ear"], errors="coerce").to_numpy(np.float64).copy()
    ear[ear <= 0] = np.nan
    ear, _ = bridge_gaps(ear, 1)
    tags = table["tag"].fillna("0")
    blinks, closed = [], []
    for start, end in runs((tags != "0").to_numpy()):
        shut = runs(tags[start:end].str.startswith("close").to_numpy())
        longest = max((stop - first for first, stop in shut), default=0) / 30
        (closed if longest >= CLOSED_EYE_S else blinks).append((start / 30, end / 30))
    return ear, blinks, closed


def jackknife(totals: Sequence[Array]) -> float:
    """Standard error of F1 from leaving out one recording at a time."""
    whole = np.sum(totals, axis=0)
    left_out = np.array([f1(whole - one) for one in totals])
    count = len(totals)
    return float(np.sqrt((count - 1) / count * ((left_out - left_out.mean()) ** 2).sum()))


def f1(total: Array) -> float:
    hits, alarms, misses = total
    return float(2 * hits / max(2 * hits + alarms + misses, 1))


def rates(text: str) -> tuple[float, ...]:
    return tuple(float(part) for part in text.split(","))


def compare_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", nargs="?", type=Path, metavar="FOLDER", help="hand-labeled series")
    parser.add_argument("--seed", type=int, help=f"of the generated series ({SEED}); leaves recordings out")
    parser.add_argument("--series", type=int, default=SERIES, help=f"generated series a rate ({SERIES})")
    parser.add_argument("--rates", type=rates, default=RATES, help="frames/s, separated by commas")
    return parser.parse_args()


def compare_methods() -> None:
    asked = compare_arguments()
    if asked.folder is not None and asked.seed is not None:
        raise SystemExit("FOLDER or --seed: a seed draws generated series alone")
    for fps in asked.rates:
        compare_generated(fps, SEED if asked.seed is None else asked.seed, asked.series)
    sys.stdout.write("called blinks, all rates: (held, brief) of (held, brief)\n")
    for name, (held, brief, all_held, all_brief) in TOTALS.items():
        sys.stdout.write(f"  {name:16} {held} of {all_held} held, {brief} of {all_brief} brief\n")
    if OF_FAST:
        sys.stdout.write(f"all generated series of {FAST:g} frames/s and more\n")
    for name, totals in OF_FAST.items():
        say_counts(name, np.sum(totals, axis=0), f", standard error over series {jackknife(totals):.3f}")
    if asked.seed is None:
        measured_by_others()
    if asked.folder is not None:
        compare_recorded(asked.folder)


BESIDE_S = 0.1
FAINT_DEPTH, FAINT_NOISES = 0.2, 5.0


def listed_as(motion: Motion, events: Sequence[LidEvent]) -> str:
    """What the classifier lists at the hold of a blink that it missed; a blink there belongs to another."""
    first = motion.onset_s + motion.down_s - SLACK_S
    last = motion.end_s - motion.up_s + SLACK_S
    kinds = [event.kind for event in events if first <= event.minimum_s <= last]
    order = ("squint", "closed_eye", "gaze_shift", "blink")
    return next((kind for kind in order if kind in kinds), "nothing")


def circumstance(motion: Motion, motions: Sequence[Motion]) -> str:
    """Whether a blink lies on a gaze shift, next to another blink, or alone."""
    others = [other for other in motions if other is not motion]
    if any(other.onset_s < motion.end_s and other.end_s > motion.onset_s for other in others):
        return "on a gaze shift"
    gaps = [max(o.onset_s - motion.end_s, motion.onset_s - o.end_s) for o in others if o.kind == "blink"]
    return "next to a blink" if any(gap < BESIDE_S for gap in gaps) else "alone"


def is_faint(motion: Motion, series: GeneratedSeries) -> bool:
    """Whether the dip of a blink, in the first eye, hardly rises above what goes on."""
    depth = depth_of(series.distances[0], series.fps)
    first, last = (int(time * series.fps) for time in (motion.onset_s, motion.end_s))
    deepest = float(depth.smooth[first : last + 1].max())
    return deepest < max(FAINT_DEPTH, FAINT_NOISES * depth.noise)


def say_circumstances(title: str, counts: Counter[str]) -> None:
    parts = ", ".join(f"{count} {name}" for name, count in counts.most_common())
    sys.stdout.write(f"{title}: {parts or 'none'}\n")


def judge(series: Sequence[GeneratedSeries]) -> None:
    """Print the errors of some series."""
    totals, false = np.zeros(3), Counter[str]()
    missed: dict[str, Counter[str]] = {}
    for one in series:
        eyes = [BlinkSeries(distance=d, fps=one.fps, column="d", is_px=False) for d in one.distances]
        events = recognise(eyes)[0].events
        true = [motion for motion in one.motions if motion.kind == "blink"]
        told = [event for event in events if event.kind == "blink"]
        hits = matched([event.minimum_s for event in told], [(m.onset_s, m.end_s) for m in true])
        lost = [motion for motion, hit in zip(true, hits, strict=True) if hit is None]
        free = [event for event in told if event.minimum_s not in hits]
        totals += [len(true) - len(lost), len(free), len(lost)]
        for motion in lost:
            of_kind = missed.setdefault(listed_as(motion, events), Counter())
            of_kind["in all"] += 1
            of_kind["full" if motion.depth == 1 else "partial"] += 1
            of_kind[circumstance(motion, one.motions)] += 1
            of_kind["faint"] += is_faint(motion, one)
        for event in free:
            kinds = [m.kind for m in one.motions if m.onset_s <= event.minimum_s <= m.end_s]
            false["blink detected twice" if "blink" in kinds else kinds[0] if kinds else "nothing"] += 1
    right, alarms, misses = totals
    sys.stdout.write(f"F1 {f1(totals):.3f} ({right:.0f} hits, {alarms:.0f} false, {misses:.0f} missed)\n")
    for kind, counts in sorted(missed.items(), key=lambda item: -item[1]["in all"]):
        say_circumstances(f"missed, listed as {kind}", counts)
    say_circumstances("false, in truth", false)


def print_errors() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=7001)
    parser.add_argument("--series", type=int, default=40, help="a rate (40)")
    parser.add_argument("--rates", type=rates, default=(120.0, 240.0), help="frames/s, separated by commas")
    asked = parser.parse_args()
    judge(
        [
            generate(np.random.default_rng([asked.seed, number, int(fps)]), 40, fps)
            for fps in asked.rates
            for number in range(asked.series)
        ]
    )


CHANGE_COST = 0.3
OPEN_FRAMES = 151


def relative(ear: Array) -> Array:
    """Aspect ratio against the upper fifth of the five seconds about each frame."""
    series = pd.Series(ear).interpolate(limit_direction="both")
    return (series / series.rolling(OPEN_FRAMES, center=True, min_periods=1).quantile(0.8)).to_numpy()


def shifts(ear: Array, blinks: list[tuple[int, int]], lacking: int) -> list[int]:
    """Frames by which each labeled blink lies later in the series, by dynamic programming."""
    level, places = relative(ear), np.arange(lacking + 3)
    cost = np.array(
        [
            [
                min(1.0, level[np.clip(np.arange(start, end) + s, 0, ear.size - 1)].mean())
                for s in places.tolist()
            ]
            for start, end in blinks
        ]
    )
    change = np.where(places[:, None] > places, np.inf, CHANGE_COST * (places[:, None] != places))
    total, origins = cost[0], []
    for row in cost[1:]:
        paths = total[:, None] + change
        origins.append(paths.argmin(0))
        total = row + paths.min(0)
    chosen = [int(total.argmin())]
    for origin in reversed(origins):
        chosen.append(int(origin[chosen[-1]]))
    return chosen[::-1]


def labelled(ear: Array, target: Array) -> pd.DataFrame:
    """Frame, aspect ratio (0 where no face was seen) and tag ('0' outside blinks) of one video."""
    blinks = list(runs(target > 0))
    tags = np.full(ear.size, "0")
    moved = shifts(ear, blinks, max(0, ear.size - target.size))
    for number, ((start, end), shift) in enumerate(zip(blinks, moved, strict=True)):
        tags[start + shift : end + shift] = str(number % 9 + 1)
    return pd.DataFrame({"frame": np.arange(ear.size), "ear": np.nan_to_num(ear), "tag": tags})


def write_webcam_series() -> None:
    folder, out = Path(sys.argv[1]), Path(sys.argv[2])
    out.mkdir(parents=True, exist_ok=True)
    lines = (folder / "zzz_target.txt").read_text(encoding="utf-8").strip().splitlines()
    for number, line in enumerate(lines, 1):
        texts = (folder / f"ear{number}.txt").read_text(encoding="utf-8").split()
        ear = np.array([np.nan if text == "None" else float(text) for text in texts])
        table = labelled(ear, np.array(line.split(), int))
        table.to_csv(out / f"eyeblink8-{number}.csv", index=False)
        sys.stdout.write(f"eyeblink8-{number}.csv: {len(table)} frames\n")


PARTS = {
    "compare": compare_methods,
    "errors": print_errors,
    "webcam": write_webcam_series,
}

if __name__ == "__main__":
    sys.exit(run_part(PARTS))
