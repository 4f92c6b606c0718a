"""Blinks told from squints, gaze shifts and closed eyes: classifier, prominent peaks, the paper's rule.

    python tests/bench/bench_lid_events.py [FOLDER]

Prints precision, recall and F1 on generated series that trained nothing, at several rates, and how many
squints and closed eyes were called blinks. FOLDER, where given, holds hand-labelled series: CSV files with
the columns frame, ear and tag ('0' where no blink is), 30 frames a second, as made from the eyeblink8 videos.

The peaks are in the style of JeFaPaTo: prominence 0.05 of an eye aspect ratio of 0.3, widths of 20 to 100 and
distances of 50 frames at 240 frames a second.
"""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.signal import find_peaks

from stimuli_builder.blinks.events.generated import generate
from stimuli_builder.blinks.events.recognise import recognise
from stimuli_builder.blinks.labelling import label_blinks
from stimuli_builder.blinks.profile import Array
from stimuli_builder.blinks.series import BlinkSeries, bridge_gaps, runs

SEED = 909
SERIES = 20
SLACK_S = 0.1
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


def counts(found: Sequence[float], true: Sequence[tuple[float, float]]) -> Array:
    """Hits, false alarms and misses; each blink is matched once."""
    free = sorted(found)
    hits = 0
    for start, end in true:
        inside = [time for time in free if start - SLACK_S <= time <= end + SLACK_S]
        hits += bool(inside)
        if inside:
            free.remove(inside[0])
    return np.array([hits, len(found) - hits, len(true) - hits], float)


def tell(name: str, total: Array, more: str = "") -> None:
    hits, alarms, misses = total
    precision, recall = hits / max(hits + alarms, 1), hits / max(hits + misses, 1)
    f1 = 2 * hits / max(2 * hits + alarms + misses, 1)
    line = f"  {name:16} precision {precision:.3f}  recall {recall:.3f}  F1 {f1:.3f}"
    sys.stdout.write(f"{line}  ({hits:.0f} hits, {alarms:.0f} false, {misses:.0f} missed){more}\n")


def generated(fps: float) -> None:
    sys.stdout.write(f"generated series, {fps:g} frames/s\n")
    series = [generate(np.random.default_rng([SEED, n, int(fps)]), 40, fps) for n in range(SERIES)]
    for name, method in METHODS.items():
        total, called, flat = np.zeros(3), 0, 0
        for one in series:
            found = method(one.distances, fps)
            total += counts(found, [(m.onset_s, m.end_s) for m in one.motions if m.kind == "blink"])
            shut = [m for m in one.motions if m.kind in ("squint", "closed_eye")]
            flat += len(shut)
            called += sum(any(m.onset_s <= time <= m.end_s for time in found) for m in shut)
        tell(name, total, f", {called} of {flat} squints and closed eyes called blinks")


def recorded(folder: Path) -> None:
    files = sorted(folder.glob("*.csv"))
    sys.stdout.write(f"{len(files)} hand-labelled series, 30 frames/s, one column, {folder}\n")
    for name, method in METHODS.items():
        total = np.zeros(3)
        for file in files:
            table = pd.read_csv(file, dtype={"tag": str})
            ear = pd.to_numeric(table["ear"], errors="coerce").to_numpy(np.float64).copy()
            ear[ear <= 0] = np.nan
            ear, _ = bridge_gaps(ear, 1)
            true = runs((table["tag"].fillna("0") != "0").to_numpy())
            total += counts(method([ear], 30.0), [(start / 30, end / 30) for start, end in true])
        tell(name, total)


def main() -> None:
    for fps in (15.0, 30.0, 60.0, 120.0, 500.0):
        generated(fps)
    if len(sys.argv) > 1:
        recorded(Path(sys.argv[1]))


if __name__ == "__main__":
    main()
