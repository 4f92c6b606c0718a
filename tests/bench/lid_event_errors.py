"""What the classifier of lid events makes of the blinks that it misses, on generated series.

    PYTHONPATH=. python tests/bench/lid_event_errors.py [--seed 7001] [--series 40] [--rates 120,240]

Blinks are matched as in `bench_lid_events.py`, the first eye's. Each one missed is counted by what the
classifier lists with its deepest moment at the hold (a squint, a gaze shift, a closed eye, a blink that
another has taken, nothing) and by what the generator did: full or partial, on a gaze shift, beside another
blink (less than 0.1 s away), alone. `faint` counts those whose depth is below 0.2 or below five times the
noise of a frame. False blinks are counted by the event that they lie in.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Sequence

import numpy as np
from bench_lid_events import SLACK_S, f1, matched, rates

from stimuli_builder.blinks.events.candidates import depth_of
from stimuli_builder.blinks.events.generated import Generated, Motion, generate
from stimuli_builder.blinks.events.recognise import recognise
from stimuli_builder.blinks.events.rules import LidEvent
from stimuli_builder.blinks.series import BlinkSeries

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
    """Whether a blink lies on a gaze shift, beside another blink, or alone."""
    others = [other for other in motions if other is not motion]
    if any(other.onset_s < motion.end_s and other.end_s > motion.onset_s for other in others):
        return "on a gaze shift"
    gaps = [max(o.onset_s - motion.end_s, motion.onset_s - o.end_s) for o in others if o.kind == "blink"]
    return "beside a blink" if any(gap < BESIDE_S for gap in gaps) else "alone"


def is_faint(motion: Motion, series: Generated) -> bool:
    """Whether the dip of a blink, in the first eye, hardly rises above what goes on."""
    depth = depth_of(series.distances[0], series.fps)
    first, last = (int(time * series.fps) for time in (motion.onset_s, motion.end_s))
    deepest = float(depth.smooth[first : last + 1].max())
    return deepest < max(FAINT_DEPTH, FAINT_NOISES * depth.noise)


def tell(title: str, counts: Counter[str]) -> None:
    parts = ", ".join(f"{count} {name}" for name, count in counts.most_common())
    sys.stdout.write(f"{title}: {parts or 'none'}\n")


def judge(series: Sequence[Generated]) -> None:
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
            false["blink told twice" if "blink" in kinds else kinds[0] if kinds else "nothing"] += 1
    right, alarms, misses = totals
    sys.stdout.write(f"F1 {f1(totals):.3f} ({right:.0f} hits, {alarms:.0f} false, {misses:.0f} missed)\n")
    for kind, counts in sorted(missed.items(), key=lambda item: -item[1]["in all"]):
        tell(f"missed, listed as {kind}", counts)
    tell("false, in truth", false)


def main() -> None:
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


if __name__ == "__main__":
    main()
