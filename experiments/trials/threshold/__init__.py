"""Adaptive series over a rendered grid: where along a factor does an answer change?"""

from experiments.schema.effects import Effect
from experiments.trials.kind import Kind
from experiments.trials.threshold.answer import ThresholdAnswer, check_response
from experiments.trials.threshold.columns import THRESHOLDS
from experiments.trials.threshold.declaration import Threshold
from experiments.trials.threshold.faults import fault
from experiments.trials.threshold.page import ShownThreshold, shown
from experiments.trials.threshold.plan import assign, block_size, plan

EFFECTS: dict[str, Effect] = {
    "kind": "measured",
    "question": "measured",
    "task": "measured",
    "stimulus": "measured",
    "series": "measured",
    "function": "measured",
    "direction": "measured",
    "lapse": "measured",
    "thresholds": "measured",
    "spreads": "measured",
    "tilts": "measured",
    "stop": "measured",
    "ahead": "measured",
    "pointer_delay_ms": "wording",
    "expected_seconds": "wording",
}

EXAMPLE = """\
[trial]
kind = "threshold"
question = { en = "Did the lower lid move?", de = "Hat sich das Unterlid bewegt?" }
stimulus = { factor = "lower_lid", values = { none = 0, horizontal = 1, vertical = 2, both = 3 } }
series = [{ name = "first_run" }, { name = "second_run" }]
function = "normal"
direction = "rising"
lapse = 0.02
thresholds = { lowest = -0.5, highest = 3.5, steps = 33 }
spreads = { lowest = 0.25, highest = 2.0, steps = 8 }
stop = { trials = 30, at_least = 12, sd = 0.25, entropy = 4.0 }
ahead = 3
pointer_delay_ms = 1500
expected_seconds = 5.0

[trial.task]
asks = "yes_no"
yes = { en = "Yes", de = "Ja" }
no = { en = "No", de = "Nein" }
guess = 0.02
"""

FURTHER_EXAMPLES = (
    """\
[trial]
kind = "threshold"
question = { en = "In which blink did the lower lid move more?" }
stimulus = { factor = "lower_lid", values = { horizontal = 1, vertical = 2, both = 3 } }
series = [{ name = "lid", levels = { character = "cartoon" } }]
function = "weibull"
stop = { trials = 40 }

[trial.task]
asks = "two_interval"
standard = "none"
first = { en = "The first" }
second = { en = "The second" }
gap_ms = 500
""",
    """\
[trial]
kind = "threshold"
question = { en = "Which blink was slower?" }
tilts = { lowest = -1.0, highest = 1.0, steps = 9 }
stop = { trials = 40 }

[trial.stimulus]
factor = "duration"
second = { factor = "lower_lid", values = { none = 0, horizontal = 1, both = 2 } }

[trial.task]
asks = "two_interval"
standard = "100"
standard_second = "none"
first = { en = "The first" }
second = { en = "The second" }
""",
)

THRESHOLD = Kind(
    declaration=Threshold,
    answer=ThresholdAnswer,
    view=THRESHOLDS,
    roles=("shown",),
    effects=EFFECTS,
    page=ShownThreshold,
    shown=shown,
    assign=assign,
    block_size=block_size,
    example=EXAMPLE,
    further_examples=FURTHER_EXAMPLES,
    plan=plan,
    fault=fault,
    check_response=check_response,
    adapts=True,
    groups=True,
)
