"""Blinks told from squints, gaze shifts and closed eyes: classifier, prominent peaks, the paper's rule.

    python tests/bench/bench_lid_events.py [FOLDER]
    python tests/bench/bench_lid_events.py --seed 8001 --series 24 --rates 30,120,240    # no recordings

Prints precision, recall and F1 on generated series that trained nothing, at several rates, and how many
squints and closed eyes were called blinks: those held for 0.25 s or more, and brief ones.
FOLDER, where given, holds hand-labelled series: CSV files with
the columns frame, ear and tag ('0' where no blink is), 30 frames a second, as made from the eyeblink8 videos
(`webcam_series.py`). Recordings of ../shared/data, where there, are compared with a table made by others.

The peaks are in the style of JeFaPaTo: prominence 0.05 of an eye aspect ratio of 0.3, widths of 20 to 100 and
distances of 50 frames at 240 frames a second.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.signal import find_peaks

from stimuli_builder.blinks.events.generated import CLOSED_EYE_S, generate
from stimuli_builder.blinks.events.recognise import recognise
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
    found, _ = find_peaks(
        -series,
        distance=max(1, 50 * fps / 240),
        prominence=0.05 / 0.3 * open_level,
        width=(20 * fps / 240, 100 * fps / 240),
    )
    return (found / fps).tolist()


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


def counts(found: Sequence[float], true: Sequence[tuple[float, float]]) -> Array:
    """Hits, false alarms and misses; each blink is matched once."""
    hits = sum(time is not None for time in matched(found, true))
    return np.array([hits, len(found) - hits, len(true) - hits], float)


def tell(name: str, total: Array, more: str = "") -> None:
    hits, alarms, misses = total
    precision, recall = hits / max(hits + alarms, 1), hits / max(hits + misses, 1)
    line = f"  {name:16} precision {precision:.3f}  recall {recall:.3f}  F1 {f1(total):.3f}"
    sys.stdout.write(f"{line}  ({hits:.0f} hits, {alarms:.0f} false, {misses:.0f} missed){more}\n")


def generated(fps: float, seed: int, count: int) -> None:
    sys.stdout.write(f"generated series, {fps:g} frames/s\n")
    series = [generate(np.random.default_rng([seed, n, int(fps)]), 40, fps) for n in range(count)]
    for name, method in METHODS.items():
        totals, called, shut = [], np.zeros(2, int), np.zeros(2, int)
        for one in series:
            found = method(one.distances, fps)
            totals.append(counts(found, [(m.onset_s, m.end_s) for m in one.motions if m.kind == "blink"]))
            for m in one.motions:
                if m.kind in ("squint", "closed_eye"):
                    brief = int(m.hold_s < HELD_S)
                    shut[brief] += 1
                    called[brief] += any(m.onset_s <= time <= m.end_s for time in found)
        TOTALS[name] = TOTALS.get(name, 0) + np.array([*called, *shut])
        if fps >= FAST:
            OF_FAST.setdefault(name, []).extend(totals)
        tell(
            name,
            np.sum(totals, axis=0),
            f", called blinks: {called[0]} of {shut[0]} held, {called[1]} of {shut[1]} brief",
        )


def recorded(folder: Path) -> None:
    files = sorted(folder.glob("*.csv"))
    sys.stdout.write(f"{len(files)} hand-labelled series, 30 frames/s, one column, {folder}\n")
    series = [hand_labelled(file) for file in files]
    for name, method in METHODS.items():
        as_labelled, as_defined = [], []
        for ear, blinks, closed in series:
            found = method([ear], 30.0)
            as_labelled.append(counts(found, blinks + closed))
            elsewhere = [t for t in found if not any(a - SLACK_S <= t <= b + SLACK_S for a, b in closed)]
            as_defined.append(counts(elsewhere, blinks))
        tell(
            name,
            np.sum(as_labelled, axis=0),
            f", standard error over recordings {jackknife(as_labelled):.3f}",
        )
        tell("  no closed eyes", np.sum(as_defined, axis=0))


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
                found = method([eyes[side], eyes[other]], 240.0)
                totals.append(counts(found, [(time, time) for time in seen]))
        tell(name, np.sum(totals, axis=0))


def hand_labelled(file: Path) -> tuple[Array, list[tuple[float, float]], list[tuple[float, float]]]:
    """Eye aspect ratio, the labelled blinks, and those shut for half a second: closed eyes."""
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


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", nargs="?", type=Path, metavar="FOLDER", help="hand-labelled series")
    parser.add_argument("--seed", type=int, help=f"of the generated series ({SEED}); leaves recordings out")
    parser.add_argument("--series", type=int, default=SERIES, help=f"generated series a rate ({SERIES})")
    parser.add_argument("--rates", type=rates, default=RATES, help="frames/s, separated by commas")
    return parser.parse_args()


def main() -> None:
    asked = arguments()
    if asked.folder is not None and asked.seed is not None:
        raise SystemExit("FOLDER or --seed: a seed draws generated series alone")
    for fps in asked.rates:
        generated(fps, SEED if asked.seed is None else asked.seed, asked.series)
    sys.stdout.write("called blinks, all rates: (held, brief) of (held, brief)\n")
    for name, (held, brief, all_held, all_brief) in TOTALS.items():
        sys.stdout.write(f"  {name:16} {held} of {all_held} held, {brief} of {all_brief} brief\n")
    if OF_FAST:
        sys.stdout.write(f"all generated series of {FAST:g} frames/s and more\n")
    for name, totals in OF_FAST.items():
        tell(name, np.sum(totals, axis=0), f", standard error over series {jackknife(totals):.3f}")
    if asked.seed is None:
        measured_by_others()
    if asked.folder is not None:
        recorded(asked.folder)


if __name__ == "__main__":
    main()
