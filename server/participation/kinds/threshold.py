"""The threshold: yes or no to one clip, or which of two in turn; answers decide what is shown next."""

import random
from collections.abc import Mapping
from typing import Any

from experiments.declaration.experiment import Experiment
from experiments.declaration.threshold import CODES, ThresholdAnswer, YesNo, threshold_of
from server.core.errors import Invalid
from server.participation.answer_schemas import Part, RatingIn
from server.participation.kinds import Preference, ServedKind, answer_of, asked_in
from server.participation.kinds.clip_rating import RatingMissing
from server.participation.tallies import NumberedClip, TallyEntry
from server.participation.verdict import Ruling, judge_several, playback_of
from server.participation.verdict import judge as judge_play
from server.participation.versions import LoadedVersion


class NoSuchAnswer(Invalid, code="no_such_answer"):
    """The task has other answers."""


def validate(experiment: Experiment, part: Part, rating: RatingIn) -> None:
    """Refuse an answer of the other task, and a check without an answer."""
    task, answer = threshold_of(experiment).task, answer_of(rating, ThresholdAnswer)
    allowed = ("yes", "no") if isinstance(task, YesNo) else ("first", "second")
    if answer.chosen is not None and answer.chosen not in allowed:
        raise NoSuchAnswer(f"Expected {' or '.join(allowed)}, got {answer.chosen}.")
    if answer.chosen is None and part == "attention":
        raise RatingMissing("Expected an answer, got none; only a clip that failed may go without.")


def judge(loaded: LoadedVersion, clips: Mapping[str, int], rating: RatingIn) -> Ruling:
    """The verdict on the one clip, or on both: each must be that assigned, with every frame of each."""
    rules, rated = loaded.experiment.playback, rating.answer.given
    playback = playback_of(rating.playback)
    if not clips:
        return judge_play(rules, playback, None, 0, 0.0, rated=rated)
    assigned = {role: loaded.clips[clip] for role, clip in clips.items()}
    frames = sum(clip.frames for clip in assigned.values())
    if len(assigned) > 1:
        return judge_several(rules, assigned, frames, rating)
    (only,) = assigned.values()
    return judge_play(rules, playback, only.sha256, frames, only.fps, rated=rated)


def simulated(
    preference: Preference, trial: Mapping[str, Any], declared: Mapping[str, Any], rng: random.Random
) -> dict[str, Any]:
    """The answer of a simulated observer: yes, or the interval of the stimulus, as likely as they see it."""
    names = [answer["response"] for answer in declared["answers"]]
    series = trial["series"] or {"known": 0}
    if not trial["clips"]:
        return {"kind": "threshold", "chosen": names[asked_in(trial["prompt"]) - 1]}
    seen = [preference.sees(clip["clip_sha256"]) for clip in trial["clips"]]
    if len(seen) == 1:
        chosen = names[0] if rng.random() < seen[0] else names[1]
    else:
        # The standard is not a stimulus, so that nothing is seen in it.
        stimulus = 0 if seen[0] >= seen[1] else 1
        chosen = names[stimulus] if rng.random() < seen[stimulus] else names[1 - stimulus]
    return {"kind": "threshold", "chosen": chosen, "known": series["known"]}


def counted(clips: Mapping[str, NumberedClip], payload: Mapping[str, Any]) -> list[TallyEntry]:
    """Yes as 1 and no as 0, so that a cell's mean is its share of yes; of two clips, the answer's number."""
    if payload["chosen"] is None:
        return []
    if "shown" in clips:
        shown = clips["shown"]
        return [TallyEntry("", shown.clip, None, float(payload["chosen"] == "yes"), shown.cell)]
    return [TallyEntry("", clips["first"].clip, clips["second"].clip, CODES[payload["chosen"]])]


SERVED = ServedKind(validate, judge, simulated, counted)
