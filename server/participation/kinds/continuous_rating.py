"""The continuous rating: a trace of one play of one clip, sampled at its frames."""

import math
import random
from collections.abc import Mapping
from typing import Any

from experiments.declaration.continuous_rating import (
    ContinuousAnswer,
    continuous_rating_of,
    samples_of,
    step_frames,
)
from experiments.declaration.experiment import Experiment
from server.core.errors import Invalid
from server.participation.answer_schemas import Part, RatingIn
from server.participation.kinds import Preference, ServedKind, answer_of, asked_in
from server.participation.kinds.clip_rating import RatingMissing, RatingOutOfScale
from server.participation.tallies import NumberedClip, TallyEntry
from server.participation.verdict import Ruling, playback_of
from server.participation.verdict import judge as judge_play
from server.participation.versions import LoadedVersion

LAG_S, RISE_S, HEIGHT_SHARE = 0.8, 0.6, 0.12
"""A simulated person begins to answer a blink after LAG_S; the answer is highest RISE_S later, by
HEIGHT_SHARE of the range."""
DRIFT_SHARE = 0.01
"""Spread of a simulated person's wandering from sample to sample, as a share of the range."""


class TraceMissing(Invalid, code="trace_missing"):
    """A trace comes with its step, an attention check with a number."""


def validate(experiment: Experiment, part: Part, rating: RatingIn) -> None:
    """Refuse a trace off the range or without its step, and a check without a number."""
    trial, answer = continuous_rating_of(experiment), answer_of(rating, ContinuousAnswer)
    if part == "attention":
        if answer.chosen is None:
            raise RatingMissing("Expected a number, got none; only a clip that failed may go without.")
        return
    if answer.chosen is not None or (answer.values is None) != (answer.step_frames is None):
        raise TraceMissing("Expected values with their step_frames, or neither where the clip failed.")
    for value in answer.values or ():
        if not trial.minimum <= value <= trial.maximum:
            raise RatingOutOfScale(
                f"Expected values from {trial.minimum:g} to {trial.maximum:g}, got {value:g}."
            )


def judge(loaded: LoadedVersion, clips: Mapping[str, int], rating: RatingIn) -> Ruling:
    """The verdict on the play; it fails too where the trace has not a value for each sampled frame."""
    rules, answer = loaded.experiment.playback, answer_of(rating, ContinuousAnswer)
    playback = playback_of(rating.playback)
    if not clips:
        return judge_play(rules, playback, None, 0, 0.0, rated=answer.given)
    clip = loaded.clips[clips["shown"]]
    if answer.values is not None:
        step = step_frames(clip.fps, continuous_rating_of(loaded.experiment).sample_hz)
        if (answer.step_frames, len(answer.values)) != (step, samples_of(clip.frames, step)):
            return "failed", "wrong_trace"
    return judge_play(rules, playback, clip.sha256, clip.frames, clip.fps, rated=answer.given)


def simulated(
    preference: Preference, trial: Mapping[str, Any], declared: Mapping[str, Any], rng: random.Random
) -> dict[str, Any]:
    """The trace of a simulated person: how they like the clip, a rise after each of its blinks, and drift."""
    if not trial["clips"]:
        return {"kind": "continuous_rating", "chosen": asked_in(trial["prompt"])}
    clip = trial["clips"][0]
    low, high = declared["minimum"], declared["maximum"]
    step = step_frames(clip["fps"], declared["sample_hz"])
    # A liking is in points of a seven-point scale, which has six steps between its ends.
    level = 0.5 + preference(clip["clip_sha256"]) / 6
    drift, values = 0.0, []
    for sample in range(samples_of(clip["frames"], step)):
        time_s = sample * step / clip["fps"]
        # Drawn back toward 0, or the wandering would leave the scale in the end.
        drift += rng.gauss(-0.02 * drift, DRIFT_SHARE)
        answered = sum(
            risen_share(time_s - onset - LAG_S) for onset in preference.blinks(clip["clip_sha256"])
        )
        share = min(1.0, max(0.0, level + drift + HEIGHT_SHARE * answered))
        values.append(round(low + (high - low) * share, 2))
    return {"kind": "continuous_rating", "values": values, "step_frames": step, "moves": 3}


def risen_share(since_s: float) -> float:
    """How far an answer has risen, 0 to 1, so long after it began: u exp(1 - u), u in RISE_S."""
    u = since_s / RISE_S
    return u * math.exp(1 - u) if u > 0 else 0.0


def counted(clips: Mapping[str, NumberedClip], payload: Mapping[str, Any]) -> list[TallyEntry]:
    """The trace's mean, by cell."""
    if payload["response"] is None:
        return []
    shown = clips["shown"]
    return [TallyEntry("", shown.clip, None, payload["response"], shown.cell)]


SERVED = ServedKind(validate, judge, simulated, counted)
