"""The paired comparison: one of two clips, or a tie where one is declared; both clips are judged."""

import math
import random
from collections.abc import Mapping
from typing import Any

from experiments.declaration.experiment import Experiment
from experiments.declaration.paired_comparison import (
    CODES,
    ComparisonAnswer,
    OneAfterTheOther,
    check_response,
    paired_comparison_of,
)
from server.core.errors import Invalid
from server.participation.answer_schemas import Part, RatingIn
from server.participation.kinds import Preference, ServedKind, answer_of, asked_in
from server.participation.kinds.clip_rating import RatingMissing
from server.participation.tallies import NumberedClip, TallyEntry
from server.participation.verdict import Ruling, judge_several, playback_of
from server.participation.verdict import judge as judge_play
from server.participation.versions import LoadedVersion

TIE_SHARE = 0.5
"""Davidson's nu of simulated people: ties against the geometric mean of the two odds."""


class NoComparison(Invalid, code="no_comparison"):
    """The answer is none to a pair."""


def validate(experiment: Experiment, part: Part, rating: RatingIn) -> None:
    """Refuse a tie where none is declared, an arrangement that is not, and a check without an answer."""
    declared, answer = paired_comparison_of(experiment), answer_of(rating, ComparisonAnswer)
    if answer.winner == "tie" and declared.ties is None:
        raise NoComparison("Expected left or right, got tie; this study declares no ties.")
    if answer.winner is None and part == "attention":
        raise RatingMissing("Expected an answer, got none; only a pair that failed may go without.")
    allowed = declared.arrangements
    if part != "attention" and answer.winner is not None and answer.arrangement not in allowed:
        raise NoComparison(
            f"Expected the arrangement {' or '.join(allowed)}, as declared; got {answer.arrangement}."
        )


def judge(loaded: LoadedVersion, clips: Mapping[str, int], rating: RatingIn) -> Ruling:
    """The verdict on a showing of all clips of the trial: each must be there, and every frame of each."""
    rules, rated = loaded.experiment.playback, rating.answer.given
    if not clips:
        return judge_play(rules, playback_of(rating.playback), None, 0, 0.0, rated=rated)
    assigned = {role: loaded.clips[clip] for role, clip in clips.items()}
    pair = [clip.frames for role, clip in assigned.items() if role != "reference"]
    in_turn = isinstance(paired_comparison_of(loaded.experiment).presentation, OneAfterTheOther)
    # The reference is shown alone before the pair, so that its frames add in either case.
    before = assigned["reference"].frames if "reference" in assigned else 0
    return judge_several(rules, assigned, before + (sum(pair) if in_turn else max(pair)), rating)


def simulated(
    preference: Preference, trial: Mapping[str, Any], declared: Mapping[str, Any], rng: random.Random
) -> dict[str, Any]:
    """The answer of a simulated person, by Davidson's model of ties with the odds of the two likings."""
    if not trial["clips"]:
        winner = list(CODES)[asked_in(trial["prompt"]) - 1]
        return {"kind": "paired_comparison", "winner": winner}
    left, right = (math.exp(2 * preference(clip["clip_sha256"])) for clip in trial["clips"][:2])
    tie = TIE_SHARE * math.sqrt(left * right) if declared["tie"] else 0.0
    winner = rng.choices(list(CODES), weights=[left, right, tie])[0]
    arrangement = declared["presentation"]["arrangement"]
    return {"kind": "paired_comparison", "winner": winner, "arrangement": arrangement}


def counted(clips: Mapping[str, NumberedClip], payload: Mapping[str, Any]) -> list[TallyEntry]:
    """The number of the answer, for left and right or first and second."""
    code = check_response(payload)
    pair = [clips[role].clip for role in ("left", "first", "right", "second") if role in clips]
    return [] if code is None else [TallyEntry("", pair[0], pair[1], code)]


SERVED = ServedKind(validate, judge, simulated, counted)
