"""One clip after another, each rated on a scale."""

from experiments.schema.effects import Effect
from experiments.trials.clip_rating.answer import RatingAnswer, check_response
from experiments.trials.clip_rating.columns import RATINGS
from experiments.trials.clip_rating.declaration import ClipRating
from experiments.trials.clip_rating.faults import fault
from experiments.trials.clip_rating.page import ShownClipRating, shown
from experiments.trials.clip_rating.plan import assign, block_size, check_choices, plan
from experiments.trials.kind import Kind

EFFECTS: dict[str, Effect] = {
    "kind": "measured",
    "scale": "measured",
    "scales": "measured",
    "arrangement": "measured",
    "views": "measured",
    "reference": "measured",
    "reference.label": "wording",
    "start": "measured",
    "fixation_ms": "measured",
    "pointer_delay_ms": "wording",
    "confirm": "measured",
    "comment": "wording",
    "expected_seconds": "wording",
}

EXAMPLE = """\
[trial]
kind = "clip_rating"
start = "key"
expected_seconds = 7.2

[trial.scale]
minimum = 1
maximum = 7
question = { en = "How natural was this blink?" }
low = { en = "very unnatural" }
high = { en = "very natural" }
"""

FURTHER_EXAMPLES = (
    """\
[trial]
kind = "clip_rating"
arrangement = "one_screen"

[[trial.scales]]
name = "naturalness"
type = "points"
minimum = 1
maximum = 5
question = { en = "How natural was this blink?" }
labels = [
    { en = "not at all" },
    { en = "a little" },
    { en = "moderately" },
    { en = "rather" },
    { en = "very" },
]

[[trial.scales]]
name = "eeriness"
type = "slider"
minimum = 0.0
maximum = 100.0
step = 1.0
question = { en = "How eerie was it?" }
low = { en = "not at all" }
high = { en = "extremely" }
show_value = true
reverse = true
not_applicable = { en = "I cannot say" }
""",
    """\
[trial]
kind = "clip_rating"

[trial.scale]
minimum = 1
maximum = 5
question = { en = "How impaired is the second clip, compared with the first?" }
labels = [
    { en = "Very annoying" },
    { en = "Annoying" },
    { en = "Slightly annoying" },
    { en = "Perceptible, but not annoying" },
    { en = "Imperceptible" },
]

[trial.reference]
factor = "compression"
level = "none"
label = { en = "Reference" }
gap_ms = 2000
rate_itself = true
""",
    """\
[trial]
kind = "clip_rating"
scale = { type = "slider", question = { en = "Alike?" }, low = { en = "no" }, high = { en = "yes" } }
reference = { cell = "none/natural", label = { en = "Reference" } }
""",
)

CLIP_RATING = Kind(
    declaration=ClipRating,
    answer=RatingAnswer,
    view=RATINGS,
    roles=("shown",),
    effects=EFFECTS,
    page=ShownClipRating,
    shown=shown,
    assign=assign,
    block_size=block_size,
    plan=plan,
    fault=fault,
    shares_clips=True,
    groups=True,
    random_factors=True,
    example=EXAMPLE,
    further_examples=FURTHER_EXAMPLES,
    check_response=check_response,
    check_choices=check_choices,
)
