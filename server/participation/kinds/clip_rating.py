"""The single-clip rating: an answer on each scale, and one play of one clip."""

import random
from collections.abc import Mapping
from typing import Any

from experiments.declaration.clip_rating import SCALE_NAME, RatingAnswer, ScaleAnswer, clip_rating_of
from experiments.declaration.experiment import Experiment
from experiments.declaration.trial import RatedScale
from experiments.kinds import scales_of
from experiments.kinds.clip_rating import ShownClipRating
from server.core.errors import Invalid
from server.participation.answer_schemas import Part, RatingIn
from server.participation.kinds import Preference, ServedKind, answer_of, asked_in
from server.participation.tallies import NumberedClip, TallyEntry
from server.participation.verdict import Ruling, judge_several, playback_of
from server.participation.verdict import judge as judge_play
from server.participation.versions import LoadedVersion

TRIAL_SD = 1.0
"""Spread of single answers of simulated people, in points of a seven-point scale."""
UNIMPAIRED = 3.0
"""Where the upper end of a scale lies, in points of a seven-point scale from its middle."""
NOT_APPLICABLE_SHARE = 0.05
"""Share of answers of simulated people that a scale does not apply, where it has that answer."""


class RatingOutOfScale(Invalid, code="rating_out_of_scale"):
    """The rating does not lie on the declared scale."""


class RatingMissing(Invalid, code="rating_missing"):
    """Only a clip that failed may go without a rating."""


class NoSuchScale(Invalid, code="no_such_scale"):
    """The study does not declare a scale of this name."""


class NoReference(Invalid, code="no_reference"):
    """The study declares no reference before its clips."""


def validate(experiment: Experiment, part: Part, rating: RatingIn) -> None:
    """Refuse other scales than those declared, a rating that is off its scale, and some but not all."""
    answer = answer_of(rating, RatingAnswer)
    if answer.reference_gap_ms is not None and clip_rating_of(experiment).reference is None:
        raise NoReference("Expected no reference_gap_ms, since this study shows no reference; got one.")
    asked = {scale.name: scale for scale in _rated_scales(experiment, part)}
    for name in answer.answers:
        if name not in asked:
            raise NoSuchScale(f"Expected answers on the scales {', '.join(asked)}; got one on {name}.")
    missing = [name for name in asked if name not in answer.answers or not answer.answers[name].given]
    # An attention check has no clip that could fail, so that it never goes without.
    failed = len(missing) == len(asked) and part != "attention"
    if missing and not failed:
        raise RatingMissing(
            f"Expected an answer on {missing[0]}, got none; only a clip that failed may go without."
        )
    for name, given in answer.answers.items():
        _check(asked[name], given)


def _rated_scales(experiment: Experiment, part: Part) -> tuple[RatedScale, ...]:
    if part == "attention":
        return (clip_rating_of(experiment).check_scale.rated("response"),)
    return scales_of(experiment)


def _check(scale: RatedScale, given: ScaleAnswer) -> None:
    if given.not_applicable and not scale.not_applicable:
        raise RatingOutOfScale(
            f"Expected a number on {scale.name}, got not_applicable, which this scale does not offer."
        )
    if given.response is not None and not scale.admits(given.response):
        numbers = "a whole number" if scale.step == 1 else f"a number in steps of {scale.step:g}"
        raise RatingOutOfScale(
            f"Expected {numbers} from {scale.minimum:g} to {scale.maximum:g} on {scale.name}, "
            f"got {given.response}."
        )


def judge(loaded: LoadedVersion, clips: Mapping[str, int], rating: RatingIn) -> Ruling:
    """The verdict on one play over all its views, or on a reference and the clip after it."""
    rules, rated = loaded.experiment.playback, rating.answer.given
    if not clips:
        return judge_play(rules, playback_of(rating.playback), None, 0, 0.0, rated=rated)
    if "reference" in clips:
        assigned = {role: loaded.clips[clip] for role, clip in clips.items()}
        return judge_several(rules, assigned, sum(clip.frames for clip in assigned.values()), rating)
    clip = loaded.clips[clips["shown"]]
    # Each view shows all frames of the clip.
    frames = clip.frames * clip_rating_of(loaded.experiment).views
    return judge_play(rules, playback_of(rating.playback), clip.sha256, frames, clip.fps, rated=rated)


def simulated(
    preference: Preference, trial: Mapping[str, Any], declared: Mapping[str, Any], rng: random.Random
) -> dict[str, Any]:
    """The answers of a simulated person: on each scale the liking around its middle, now and then that it
    does not apply where it may. After a reference it is the impairment: the best answer, and the lower the
    further the two likings lie apart.
    """
    told = ShownClipRating.model_validate(declared)
    if not trial["clips"]:
        return _answers({told.check_scale.name: {"response": asked_in(trial["prompt"])}})
    liking = preference(trial["clips"][0]["clip_sha256"])
    if told.reference:
        liking = UNIMPAIRED - abs(liking - preference(trial["clips"][1]["clip_sha256"]))
    given = _answers({scale.name: _simulated_value(scale.rated(""), liking, rng) for scale in told.scales})
    return given | ({"reference_gap_ms": told.reference.gap_ms} if told.reference else {})


def _simulated_value(scale: RatedScale, liking: float, rng: random.Random) -> dict[str, Any]:
    # A seven-point scale has six steps between its ends.
    middle, unit = (scale.minimum + scale.maximum) / 2, (scale.maximum - scale.minimum) / 6
    value = scale.nearest(middle + (-1 if scale.reverse else 1) * unit * (liking + rng.gauss(0, TRIAL_SD)))
    if scale.not_applicable and rng.random() < NOT_APPLICABLE_SHARE:
        return {"response": None, "not_applicable": True}
    return {"response": value}


def _answers(answers: dict[str, Any]) -> dict[str, Any]:
    return {"kind": "clip_rating", "answers": answers}


def counted(clips: Mapping[str, NumberedClip], payload: Mapping[str, Any]) -> list[TallyEntry]:
    """Each number by its scale; it has a mean by cell. "Not applicable" is none."""
    answers, shown = payload.get("answers", {SCALE_NAME: payload}), clips["shown"]
    return [
        TallyEntry(name, shown.clip, None, one["response"], shown.cell)
        for name, one in answers.items()
        if one["response"] is not None
    ]


SERVED = ServedKind(validate, judge, simulated, counted)
