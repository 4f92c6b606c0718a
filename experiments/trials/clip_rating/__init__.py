"""One clip after another, each rated on a scale."""

from experiments.schema.effects import Effect
from experiments.trials.clip_rating.answer import RatingAnswer
from experiments.trials.clip_rating.columns import RATINGS
from experiments.trials.clip_rating.declaration import ClipRating
from experiments.trials.clip_rating.plan import assign
from experiments.trials.kind import Kind

EFFECTS: dict[str, Effect] = {
    "kind": "measured",
    "scale": "measured",
    "views": "measured",
    "start": "measured",
    "fixation_ms": "measured",
    "confirm": "measured",
    "comment": "wording",
    "expected_seconds": "wording",
}

CLIP_RATING = Kind(
    declaration=ClipRating,
    answer=RatingAnswer,
    view=RATINGS,
    roles=("shown",),
    effects=EFFECTS,
    assign=assign,
)
