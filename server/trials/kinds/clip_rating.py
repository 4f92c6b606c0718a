"""The single-clip rating: a whole number on the scale, and one play of one clip."""

import random
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from experiments.definition import Experiment
from experiments.trials.clip_rating.declaration import clip_rating_of
from server.errors import Invalid
from server.trials.kinds import Part, Preference, Served, asked_in
from server.trials.schemas import PlaybackLog, RatingIn
from server.trials.verdict import Playback, Ruling, frames_in_log
from server.trials.verdict import judge as judge_play

if TYPE_CHECKING:
    from server.versions import LoadedVersion


TRIAL_SD = 1.0
"""Spread of single answers of simulated people, in points of a seven-point scale."""


class RatingOutOfScale(Invalid):
    """The rating does not lie on the declared scale."""

    code = "rating_out_of_scale"


class RatingMissing(Invalid):
    """Only a clip that failed may go without a rating."""

    code = "rating_missing"


def payload(rating: RatingIn) -> dict[str, Any]:
    """The rating, as its model has it."""
    return {"response": rating.response}


def validate(experiment: Experiment, part: Part, rating: RatingIn) -> None:
    """Refuse a rating beyond the scale, and a check without an answer."""
    scale = clip_rating_of(experiment).scale
    if rating.response is not None and not scale.minimum <= rating.response <= scale.maximum:
        raise RatingOutOfScale(
            f"Expected a whole number from {scale.minimum} to {scale.maximum}, got {rating.response}."
        )
    if rating.response is None and part == "attention":
        raise RatingMissing("Expected an answer, got none; only a clip that failed may go without.")


def judge(loaded: "LoadedVersion", clips: Mapping[str, int], rating: RatingIn) -> Ruling:
    """The verdict on one play over all its views, and the rule that gave it."""
    rules, rated = loaded.experiment.playback, rating.response is not None
    if not clips:
        return judge_play(rules, playback_of(rating.playback), None, 0, 0.0, rated=rated)
    clip = loaded.clips[clips["shown"]]
    frames = clip.frames * clip_rating_of(loaded.experiment).views
    return judge_play(rules, playback_of(rating.playback), clip.sha256, frames, clip.fps, rated=rated)


def playback_of(log: PlaybackLog) -> Playback:
    """What a log says of one play."""
    seen = frames_in_log(index for index, _ in log.drawn) if log.drawn is not None else None
    return Playback(
        method=log.method,
        clip_sha256=log.clip_sha256,
        frames_drawn=log.frames_drawn,
        frames_late=log.frames_late,
        frames_missing=log.frames_missing,
        longest_gap_ms=log.longest_gap_ms,
        focus_lost=bool(log.focus_lost),
        frames_seen=seen,
        refresh_rate_hz=log.refresh_rate_hz,
        clock_gap_ms=log.clock_gap_ms,
        clock_late_ms=log.clock_late_ms,
    )


def simulated(
    preference: Preference, trial: Mapping[str, Any], declared: Mapping[str, Any], rng: random.Random
) -> dict[str, Any]:
    """The rating of a simulated person: the liking around the middle of the scale, rounded into it."""
    minimum, maximum = declared["scale"]["minimum"], declared["scale"]["maximum"]
    if not trial["clips"]:
        return {"response": asked_in(trial["prompt"])}
    middle, unit = (minimum + maximum) / 2, (maximum - minimum) / 6
    value = middle + unit * (preference(trial["clips"][0]["clip_sha256"]) + rng.gauss(0, TRIAL_SD))
    return {"response": min(maximum, max(minimum, round(value)))}


SERVED = Served(payload, validate, judge, simulated)
