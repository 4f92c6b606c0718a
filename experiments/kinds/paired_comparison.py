"""Comparisons of two clips: assignment of pairs, order and sides; page model, columns."""

import random
from collections import Counter
from collections.abc import Iterable
from math import gcd
from typing import Literal

from experiments.assignment import Compared, Shown, Trial
from experiments.assignment.groups import groups, name_of, of_group, seat_of
from experiments.assignment.order import ordered_blocks, with_attention
from experiments.assignment.shares import expected_slots, said_of_groups
from experiments.columns.base import rows_of
from experiments.columns.column import Column
from experiments.columns.playback import answer_columns
from experiments.columns.view import View
from experiments.declaration.base import Declaration, Translated
from experiments.declaration.experiment import Experiment
from experiments.declaration.paired_comparison import (
    Active,
    ComparisonAnswer,
    IncompleteBlocks,
    PairedComparison,
    Presentation,
    check_response,
    paired_comparison_of,
)
from experiments.declaration.trial import BlockSpec, ClipSpec
from experiments.errors import InputError
from experiments.kinds.kind import Kind, PlanCommand
from experiments.kinds.pair_choice import chosen_pairs
from experiments.kinds.pairs import BlockDeal, Deal, Pair, check_connected, every_pair, fault, item_of
from experiments.schema.effects import Effect

# Exports of a comparison: the base columns, both clips and the chosen one, one row per presentation of a
# pair. If two clips are shown one after the other, the first is the left one.

_ROLES = {"left": "lc", "right": "rc", "first": "fc", "second": "sc", "reference": "xc"}


def _side(side: str, one: str, other: str) -> tuple[Column, ...]:
    def either(column: str) -> str:
        return f"coalesce({one}.{column}, {other}.{column})"

    return (
        Column(
            f"{side}_cell",
            "text",
            f"Cell of the {side} clip: level names, separated by slashes.",
            source=either("cell"),
        ),
        Column(
            f"{side}_exemplar",
            "integer",
            f"Exemplar number of the {side} clip in its cell, from 1.",
            minimum=1,
            source=either("exemplar"),
        ),
        Column(f"{side}_stimulus", "text", f"File name of the {side} clip.", source=either("file")),
        Column(
            f"{side}_clip_sha256",
            "text",
            f"SHA-256 of the bytes of the {side} clip.",
            source=either("clip_sha256"),
        ),
    )


ANSWER: tuple[Column, ...] = (
    Column(
        "winner",
        "text",
        "The chosen clip, or tie.",
        values=("left", "right", "tie"),
        source="t.payload",
        member="winner",
    ),
    Column(
        "arrangement",
        "text",
        "How the two clips were shown: side by side or stacked at once, or in turn (left is then the first).",
        values=("side_by_side", "stacked", "one_after_the_other"),
        source="t.payload",
        member="arrangement",
    ),
    Column(
        "expected_response",
        "integer",
        "The required answer in an attention check (1 left or first, 2 right or second, 3 tie), or the "
        "correct answer in a motion check.",
        source="a",
    ),
)

SHOWN: tuple[Column, ...] = (
    *_side("left", "lc", "fc"),
    *_side("right", "rc", "sc"),
    Column("reference", "text", "Cell of the reference clip shown before the pair.", source="xc.cell"),
)

COMPARISONS = View(
    name="comparisons",
    title="Comparisons: one row per presentation of a pair",
    columns=answer_columns(SHOWN, ANSWER),
    rows=rows_of("paired_comparison", _ROLES),
)


# What the participant's page receives about a paired comparison.


class ShownReference(Declaration):
    """The label of the reference and the length of the blank gap after it, but not which clip it is."""

    label: Translated
    gap_ms: int


class ShownPairedComparison(Declaration):
    """The declared paired comparison as the page receives it, without the pairs."""

    kind: Literal["paired_comparison"]
    question: Translated
    presentation: Presentation
    tie: Translated | None
    reference: ShownReference | None
    pointer_delay_ms: int
    expected_seconds: float


def shown(experiment: Experiment) -> ShownPairedComparison:
    """Return the part of the declared trial that its page needs."""
    trial = paired_comparison_of(experiment)
    reference = trial.reference
    return ShownPairedComparison(
        kind=trial.kind,
        question=trial.question,
        presentation=trial.presentation,
        tie=trial.ties and trial.ties.label,
        reference=reference and ShownReference(label=reference.label, gap_ms=reference.gap_ms),
        pointer_delay_ms=trial.pointer_delay_ms,
        expected_seconds=trial.expected_seconds,
    )


# Who compares which pairs, in which order and with which sides, and the resulting counts.


def assign(experiment: Experiment, seed: int, slot: int, compared: Iterable[Compared] = ()) -> list[Trial]:
    """The trials of one participant in order.

    Parameters
    ----------
    seed : int
        Of the order of trials and of practice.
    slot : int
        Place in the counterbalancing, which deals the group, the pairs and their sides.
    compared : iterable of Compared, optional
        What is stored, where pairs are chosen by it.
    """
    seat = seat_of(experiment, slot)
    return _of_group(of_group(experiment, seat.levels), seed, seat.number, compared)


def _of_group(
    experiment: Experiment, seed: int, number_in_group: int, compared: Iterable[Compared]
) -> list[Trial]:
    rng = random.Random(seed)
    trials = _practice(experiment, rng)
    dealt = (
        chosen_pairs(experiment, seed, compared)
        if chooses(experiment)
        else deal(experiment).of_slot(number_in_group)
    )
    times = Counter[str]()
    choices = check_choices(experiment)
    for number, block in enumerate(ordered_blocks(experiment, rng, number_in_group), start=1):
        members = set(block.clips)
        pairs = [pair for pair in dealt if pair.left in members]
        if times[block.label] % 2:
            pairs = [pair.swapped for pair in pairs]
        times[block.label] += 1
        if experiment.blocks.trial_order == "random":
            rng.shuffle(pairs)
        main = [_trial(experiment, "main", number, block.label, pair) for pair in pairs]
        trials.extend(with_attention(experiment, main, rng, lambda draw: draw.randint(1, choices)))
    return trials


def check_choices(experiment: Experiment) -> int:
    """The two sides, and the tie if it is an answer."""
    return 3 if paired_comparison_of(experiment).ties else 2


def _practice(experiment: Experiment, rng: random.Random) -> list[Trial]:
    """Pairs drawn from all of the design, sides at random."""
    pairs = every_pair(experiment)
    drawn = [rng.choice(pairs) for _ in range(experiment.practice.trials)]
    sided = [pair.swapped if rng.random() < 0.5 else pair for pair in drawn]
    return [_trial(experiment, "practice", 0, "practice", pair) for pair in sided]


def _trial(
    experiment: Experiment, kind: Literal["practice", "main"], block: int, label: str, pair: Pair
) -> Trial:
    declared = paired_comparison_of(experiment)
    shown = [Shown(role, clip) for role, clip in zip(declared.roles, pair, strict=True)]
    if declared.reference:
        levels = dict(zip(experiment.factor_names, declared.reference.cell.split("/"), strict=True))
        levels |= {factor.name: factor.levels[0].name for factor in experiment.factors if factor.between}
        shown.append(Shown("reference", ClipSpec(tuple(levels.items()), pair.left.exemplar)))
    return Trial(kind, block, label, tuple(shown))


def chooses(experiment: Experiment) -> bool:
    """True if a participant's pairs depend on the comparisons stored when they start."""
    return isinstance(paired_comparison_of(experiment).dealing, Active)


def deal(experiment: Experiment) -> Deal:
    """Who gets which pairs, if that follows from the slot."""
    dealing = paired_comparison_of(experiment).dealing
    return BlockDeal(experiment, dealing) if isinstance(dealing, IncompleteBlocks) else Deal(experiment)


def block_size(experiment: Experiment, block: BlockSpec) -> int:
    """Pairs that a group's first place compares in a block; other places have as many, or one more or less.

    Where groups differ, the most.
    """
    members = set(block.clips)
    counts = []
    for levels in groups(experiment):
        of = of_group(experiment, levels)
        first = chosen_pairs(of, 0, ()) if chooses(of) else deal(of).of_slot(0)
        counts.append(sum(pair.left in members for pair in first))
    return max(counts)


def plan(experiment: Experiment) -> tuple[str, ...]:
    """Counts over the declared participants, in words; InputError if the pairs are not connected."""
    every = groups(experiment)
    if len(every) == 1:
        return _plan_of_group(experiment)
    sizes = Counter(seat_of(experiment, slot).levels for slot in expected_slots(experiment))
    said = [said_of_groups(experiment)]
    for levels in every:
        if not sizes[levels]:
            raise InputError(
                f"'{experiment.name}': expected participants in every group, got none in "
                f"'{name_of(levels)}'; declare more participants"
            )
        of = of_group(experiment, levels).model_copy(update={"participants": sizes[levels]})
        said += [f"{name_of(levels)}: {line}" for line in _plan_of_group(of)]
    return tuple(said)


def _plan_of_group(experiment: Experiment) -> tuple[str, ...]:
    return _plan_of_choice(experiment) if chooses(experiment) else _plan_of_deal(experiment)


def _plan_of_choice(experiment: Experiment) -> tuple[str, ...]:
    trial, pairs, repeats = (
        paired_comparison_of(experiment),
        every_pair(experiment),
        experiment.blocks.repeats,
    )
    each, people = min(trial.pairs_per_person or 0, len(pairs)), experiment.participants
    check_connected(experiment, pairs)
    items = {item_of(experiment, clip) for pair in pairs for clip in pair}
    if each * people < len(items) - 1:
        raise InputError(
            f"'{experiment.name}': expected at least {len(items) - 1} comparisons to connect {len(items)} "
            f"items, got {each} by each of {people} participants; increase either number"
        )
    share = trial.dealing.random_share if isinstance(trial.dealing, Active) else 0.0
    again = f", {repeats} times each" if repeats > 1 else ""
    on_average = repeats * each * people / len(pairs)
    clips = {clip for pair in pairs for clip in pair}
    return (
        f"{len(pairs)} pairs; each participant makes {each} comparisons{again}, {round(share * each)} "
        "of them drawn at random, the others chosen from the answers so far",
        f"over {people} participants, each pair is compared {on_average:.1f} times on average, and each "
        f"clip is in {2 * repeats * each * people / len(clips):.1f} comparisons; similar clips are compared "
        f"more often",
    )


def _plan_of_deal(experiment: Experiment) -> tuple[str, ...]:
    dealt, repeats = deal(experiment), experiment.blocks.repeats
    shown = [pair for slot in range(experiment.participants) for pair in dealt.of_slot(slot)]
    check_connected(experiment, shown)
    times = Counter(frozenset(pair) for pair in shown)
    per_pair = [repeats * times[frozenset(pair)] for pair in dealt.pairs]
    clips = Counter(clip for pair in shown for clip in pair)
    per_clip = [repeats * clips[clip] for clip in {clip for pair in dealt.pairs for clip in pair}]
    again = f", {repeats} times each" if repeats > 1 else ""
    return (
        f"{len(dealt.pairs)} pairs; each participant makes {dealt.each} comparisons{again}",
        *_said_of_blocks(experiment, dealt),
        f"over {experiment.participants} participants each pair is compared {_range(per_pair)} times, "
        f"each clip is in {_range(per_clip)} comparisons",
    )


def _said_of_blocks(experiment: Experiment, dealt: Deal) -> tuple[str, ...]:
    dealing = paired_comparison_of(experiment).dealing
    if not isinstance(dealt, BlockDeal) or not isinstance(dealing, IncompleteBlocks):
        return ()
    people = dealt.round // gcd(dealt.round, dealing.blocks_per_person)
    return (
        f"{dealing.blocks_per_person} of {dealt.round} blocks of {dealing.clips_per_block} clips to each; "
        f"every pair equally often with {people} participants, and with each multiple of {people}",
    )


def _range(counts: list[int]) -> str:
    low, high = min(counts), max(counts)
    return str(low) if low == high else f"{low} to {high}"


# Two clips, at once or in turn: which of them?

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

STEP = 0.3
"""Log odds between neighboring items in a planned study: the better one wins 57 of 100."""
MAX_ITEMS = 12
"""Items for which power is simulated."""


def power_of_pairs(experiment: Experiment) -> PlanCommand:
    """Power where a participant compares every two items."""
    if any(factor.between for factor in experiment.factors):
        raise InputError("power cannot be computed: groups of participants compare different items")
    if chooses(experiment):
        raise InputError(
            "power cannot be computed before data collection: pairs are chosen from the answers so far"
        )
    pairs = every_pair(experiment)
    named = [(item_of(experiment, pair.left), item_of(experiment, pair.right)) for pair in pairs]
    items = len({item for both in named for item in both})
    if not 2 <= items <= MAX_ITEMS:
        raise InputError(f"power of pairs can be computed for 2 to {MAX_ITEMS} items, got {items}")
    of_items = items * (items - 1) // 2
    if len({frozenset(both) for both in named}) < of_items:
        raise InputError(
            "power of pairs can be computed only if all pairs of items are compared; here some are not"
        )
    shown = sum(trial.kind == "main" for trial in assign(experiment, seed=0, slot=0))
    if shown < of_items:
        raise InputError(
            f"power of pairs can be computed only if each participant compares all pairs of items; here it "
            f"is {shown} of "
            f"{of_items} pairs"
        )
    abilities = ",".join(f"{STEP * item:.1f}" for item in range(items))
    arguments = ["plan", "pairs", "--abilities", abilities]
    if (repeats := shown // of_items) > 1:
        arguments += ["--repeats", str(repeats)]
    often = {1: "once", 2: "twice"}.get(repeats, f"{repeats} times")
    return PlanCommand(
        arguments,
        f"neighboring items differ by {STEP} in log odds, each participant compares all pairs of items "
        f"{often}, and all participants have the same abilities",
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
    power=power_of_pairs,
    check_response=check_response,
    check_choices=check_choices,
    groups=True,
    chooses=chooses,
    assign_by=assign,
)
