"""The toy in the server."""

import random
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from experiments.declaration.experiment import Experiment
from server.participation.answer_schemas import Part, RatingIn
from server.participation.kinds import Preference, ServedKind, answer_of
from server.participation.tallies import NumberedClip, TallyEntry
from server.participation.verdict import Ruling
from tests.experiments.trials.toy import SameAnswer

if TYPE_CHECKING:
    from server.participation.versions import LoadedVersion


def validate(_experiment: Experiment, _part: Part, rating: RatingIn) -> None:
    answer_of(rating, SameAnswer)


def judge(_loaded: "LoadedVersion", _clips: Mapping[str, int], _rating: RatingIn) -> Ruling:
    return "good", ""


def simulated(
    _preference: Preference, _trial: Mapping[str, Any], _declared: Mapping[str, Any], rng: random.Random
) -> dict[str, Any]:
    return {"kind": "same_or_not", "same": rng.random() < 0.5}


def counted(clips: Mapping[str, NumberedClip], payload: Mapping[str, Any]) -> list[TallyEntry]:
    return [TallyEntry("", clips["first"].clip, clips["second"].clip, float(payload["same"]))]


SERVED = ServedKind(validate, judge, simulated, counted)
