"""The single-clip rating: a whole number on the scale, and one play of one clip."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from experiments.definition import Experiment
from experiments.trials.clip_rating.declaration import clip_rating_of
from server.errors import Invalid
from server.trials.kinds import Part, Served
from server.trials.schemas import PlaybackLog, RatingIn
from server.trials.verdict import Playback, Ruling, frames_in_log
from server.trials.verdict import judge as judge_play

if TYPE_CHECKING:
    from server.versions import LoadedVersion


class RatingOutOfScale(Invalid):
    """The rating does not lie on the declared scale."""

    code = "rating_out_of_scale"


class RatingMissing(Invalid):
    """Only a clip that failed may go without a rating."""

    code = "rating_missing"


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
        return judge_play(rules, _playback(rating.playback), None, 0, 0.0, rated=rated)
    clip = loaded.clips[clips["shown"]]
    frames = clip.frames * clip_rating_of(loaded.experiment).views
    return judge_play(rules, _playback(rating.playback), clip.sha256, frames, clip.fps, rated=rated)


def _playback(log: PlaybackLog) -> Playback:
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


SERVED = Served(validate, judge)
