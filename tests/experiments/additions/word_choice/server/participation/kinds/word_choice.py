"""The choice of a word: validated, judged, simulated, counted."""

import random
from collections.abc import Mapping
from typing import Any

from experiments.declaration.word_choice import WordAnswer

from experiments.declaration.experiment import Experiment
from server.participation.answer_schemas import Part, RatingIn
from server.participation.kinds import Preference, ServedKind, answer_of, asked_in
from server.participation.kinds.clip_rating import RatingMissing
from server.participation.tallies import NumberedClip, TallyEntry
from server.participation.verdict import Ruling, playback_of
from server.participation.verdict import judge as judge_play
from server.participation.versions import LoadedVersion


def validate(_experiment: Experiment, part: Part, rating: RatingIn) -> None:
    """Refuse a check without an answer."""
    if answer_of(rating, WordAnswer).chosen is None and part == "attention":
        raise RatingMissing("Expected a word, got none; only a clip that failed may go without.")


def judge(loaded: LoadedVersion, clips: Mapping[str, int], rating: RatingIn) -> Ruling:
    """The verdict on the play."""
    rules, playback, rated = loaded.experiment.playback, playback_of(rating.playback), rating.answer.given
    if not clips:
        return judge_play(rules, playback, None, 0, 0.0, rated=rated)
    clip = loaded.clips[clips["shown"]]
    return judge_play(rules, playback, clip.sha256, clip.frames, clip.fps, rated=rated)


def simulated(
    preference: Preference, trial: Mapping[str, Any], _declared: Mapping[str, Any], rng: random.Random
) -> dict[str, Any]:
    """The second word for a clip that is liked."""
    if not trial["clips"]:
        return {"kind": "word_choice", "chosen": ("first", "second")[asked_in(trial["prompt"]) - 1]}
    liked = preference(trial["clips"][0]["clip_sha256"]) + rng.gauss(0, 1) > 0
    return {"kind": "word_choice", "chosen": "second" if liked else "first"}


def counted(clips: Mapping[str, NumberedClip], payload: Mapping[str, Any]) -> list[TallyEntry]:
    """1 for the second word, by cell."""
    if payload["chosen"] is None:
        return []
    shown = clips["shown"]
    return [TallyEntry("", shown.clip, None, float(payload["chosen"] == "second"), shown.cell)]


SERVED = ServedKind(validate, judge, simulated, counted)
