"""Two clips, at once or in turn: which of them?"""

from experiments.schema.effects import Effect
from experiments.trials.kind import Kind
from experiments.trials.paired_comparison.answer import ComparisonAnswer, check_response
from experiments.trials.paired_comparison.columns import COMPARISONS
from experiments.trials.paired_comparison.declaration import PairedComparison
from experiments.trials.paired_comparison.page import ShownPairedComparison, shown
from experiments.trials.paired_comparison.pairs import fault
from experiments.trials.paired_comparison.plan import assign, block_size, check_choices, chooses, plan

EFFECTS: dict[str, Effect] = {
    "kind": "measured",
    "question": "measured",
    "presentation": "measured",
    "pairs": "measured",
    "pairs_per_person": "measured",
    "dealing": "measured",
    "ties": "measured",
    "reference": "measured",
    "pointer_delay_ms": "wording",
    "expected_seconds": "wording",
}

EXAMPLE = """\
[trial]
kind = "paired_comparison"
question = { en = "Which blink looked more natural?", de = "Welcher Lidschlag wirkte natürlicher?" }
pairs = { among = "all", exemplars = "matched" }
presentation = { arrangement = "side_by_side", gap_mm = 8.0, if_too_narrow = "stack" }
ties = { label = { en = "No difference", de = "Kein Unterschied" } }
pairs_per_person = 12
dealing = { by = "active", random_share = 0.2 }
pointer_delay_ms = 1500
expected_seconds = 8.0
"""

FURTHER_EXAMPLES = (
    """\
[trial]
kind = "paired_comparison"
question = { en = "Which of the two is more like the reference?" }
presentation = { arrangement = "one_after_the_other", gap_ms = 500 }
pairs = { among = "within", factor = "lower_lid" }
dealing = { by = "bibd", clips_per_block = 3, blocks_per_person = 4 }
reference = { cell = "both", label = { en = "Reference" }, gap_ms = 500 }
""",
    """\
[trial]
kind = "paired_comparison"
question = { en = "Which blink looked more natural?" }
presentation = { arrangement = "stacked", gap_mm = 8.0 }
pairs = { among = "declared", cells = [{ cell = "both", other = "none" }] }
dealing = { by = "turn" }
""",
)

PAIRED_COMPARISON = Kind(
    declaration=PairedComparison,
    answer=ComparisonAnswer,
    view=COMPARISONS,
    roles=("left", "right"),
    effects=EFFECTS,
    page=ShownPairedComparison,
    shown=shown,
    assign=assign,
    block_size=block_size,
    example=EXAMPLE,
    further_examples=FURTHER_EXAMPLES,
    plan=plan,
    fault=fault,
    check_response=check_response,
    check_choices=check_choices,
    groups=True,
    chooses=chooses,
    assign_by=assign,
)
