"""Pairs in balanced incomplete blocks and pairs chosen by what is stored: who gets which."""

import random
from collections import Counter
from math import exp

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments import design
from experiments.assignment import Compared, Trial
from experiments.declaration.experiment import Experiment
from experiments.errors import InputError
from experiments.kinds.paired_comparison import assign, deal, plan
from experiments.kinds.pairs import BlockDeal, every_pair
from experiments.load import DefinitionError
from tests.experiments.trials.test_paired_comparison import declared

BLOCKS = 'dealing = {{ by = "bibd", clips_per_block = {size}, blocks_per_person = {each} }}'
ACTIVE = 'dealing = {{ by = "active", random_share = {share} }}\npairs_per_person = {each}'
ANY = '{ among = "all", exemplars = "any" }'


def active(each: int = 4, share: float = 0.25, pairs: str = '{ among = "all" }') -> Experiment:
    return declared(pairs, rest=ACTIVE.format(share=share, each=each))


def main(trials: list[Trial]) -> list[tuple[str, str]]:
    """The pairs of the first block, as clips are named in lists."""
    named = [
        tuple(f"{shown.clip.cell}/{shown.clip.exemplar}" for shown in trial.shown)
        for trial in trials
        if trial.kind == "main" and trial.block == 1
    ]
    return [(pair[0], pair[1]) for pair in named]


@settings(max_examples=20, deadline=None)
@given(st.sampled_from([(2, 1), (2, 3), (3, 1), (3, 2), (4, 1)]), st.integers(1, 3), st.booleans())
def test_after_whole_rounds_each_pair_has_been_dealt_equally_often_and_on_both_sides(
    blocks: tuple[int, int], per_cell: int, any_exemplars: bool
) -> None:
    size, each = blocks
    experiment = declared(
        ANY if any_exemplars else '{ among = "all" }',
        rest=BLOCKS.format(size=size, each=each),
        per_cell=per_cell,
    )
    dealt = deal(experiment)
    assert isinstance(dealt, BlockDeal)
    people = dealt.round
    times, clips, sides = Counter[frozenset[str]](), Counter[str](), Counter[str]()
    for slot in range(people):
        pairs = main(assign(experiment, slot, slot))
        assert len(pairs) == each * size * (size - 1) // 2
        assert each > 1 or len({clip for pair in pairs for clip in pair}) == size
        times.update(frozenset(pair) for pair in pairs)
        clips.update(clip for pair in pairs for clip in pair)
        sides.update(left for left, _ in pairs)
    assert set(times) == {
        frozenset(f"{clip.cell}/{clip.exemplar}" for clip in pair) for pair in every_pair(experiment)
    }
    assert len(set(times.values())) == len(set(clips.values())) == 1
    assert len(clips) == len(design.clips(experiment))


def test_a_pair_that_is_dealt_again_has_its_sides_exchanged() -> None:
    experiment = declared(rest=BLOCKS.format(size=4, each=1), per_cell=1)
    first, second = (main(assign(experiment, 1, slot)) for slot in (0, 1))
    assert {(right, left) for left, right in first} == set(second)


@pytest.mark.parametrize(
    ("rest", "pairs", "told"),
    [
        (BLOCKS.format(size=5, each=1), '{ among = "all" }', "expected at most the 4 clips"),
        (BLOCKS.format(size=3, each=1) + "\npairs_per_person = 3", ANY, "the blocks determine"),
        (
            BLOCKS.format(size=2, each=1),
            '{ among = "declared", cells = [{ cell = "both", other = "none" }] }',
            "got a list of pairs",
        ),
        ('dealing = { by = "active" }', ANY, "pairs_per_person is required"),
        ('dealing = { by = "actve" }', ANY, "no such by 'actve'"),
    ],
)
def test_dealing_that_does_not_fit_is_reported_in_one_line(rest: str, pairs: str, told: str) -> None:
    with pytest.raises(DefinitionError, match=told) as raised:
        declared(pairs, rest=rest)
    assert "\n" not in raised.value.problems[0].message


def test_a_block_size_without_a_design_names_near_ones() -> None:
    with pytest.raises(DefinitionError, match=r"no balanced design of 20 clips in blocks of 6 .* take "):
        declared(ANY, rest=BLOCKS.format(size=6, each=1), per_cell=5)


def test_clips_that_nobody_sees_are_named_at_plan() -> None:
    experiment = declared(rest="pairs_per_person = 3", per_cell=4).model_copy(update={"participants": 1})
    with pytest.raises(InputError, match=r"groups never compared|clips that nobody sees"):
        plan(experiment)
    linked = declared(rest="pairs_per_person = 6", per_cell=8).model_copy(update={"participants": 2})
    with pytest.raises(InputError, match=r"expected every clip .* nobody sees: .*/\d"):
        plan(linked)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**53), each=st.integers(1, 12), share=st.floats(0, 1))
def test_a_choice_is_of_the_design_without_repeats_and_alike_for_alike_stores(
    seed: int, each: int, share: float
) -> None:
    experiment = active(each, share)
    rng = random.Random(seed)
    stored = [
        Compared(left, right, rng.choice(["left", "right", "tie", None]), rng.randint(1, 4))
        for left, right in main(assign(declared(), 1, 0))
        if rng.random() < 0.6
    ]
    pairs = main(assign(experiment, seed, 0, stored))
    assert pairs == main(assign(experiment, seed, 7, stored))
    known = {frozenset(f"{clip.cell}/{clip.exemplar}" for clip in pair) for pair in every_pair(experiment)}
    assert len({frozenset(pair) for pair in pairs}) == len(pairs) == each
    assert {frozenset(pair) for pair in pairs} <= known


def test_people_who_answer_alike_are_soon_asked_what_is_close_and_never_only_that() -> None:
    scores = {"both": 3.0, "vertical": 0.2, "horizontal": 0.0, "none": -3.0}
    experiment, rng = active(each=3, share=0.34), random.Random(5)
    stored: Counter[tuple[str, str, str]] = Counter()
    late = Counter[frozenset[str]]()
    for person in range(80):
        rows = [Compared(left, right, winner, times) for (left, right, winner), times in stored.items()]  # type: ignore[arg-type]
        for left, right in main(assign(experiment, person, person, rows)):
            of_left, of_right = (scores[clip.split("/")[0]] for clip in (left, right))
            winner = "left" if rng.random() < 1 / (1 + exp(of_right - of_left)) else "right"
            stored[left, right, winner] += 1
            late[frozenset((left.split("/")[0], right.split("/")[0]))] += person >= 40
    assert late[frozenset(("vertical", "horizontal"))] > 2 * late[frozenset(("both", "none"))]
    # The random share leaves no pair out.
    assert min(late.values()) >= 3
    assert len(late) == 6


def test_pairs_that_others_are_just_judging_are_left_to_them() -> None:
    experiment = active(each=3, share=0)
    first = main(assign(experiment, 1, 0))
    waiting = [Compared(left, right, None, 50) for left, right in first]
    asked = {frozenset(clip.split("/")[0] for clip in pair) for pair in first}
    second = main(assign(experiment, 1, 0, waiting))
    assert {frozenset(clip.split("/")[0] for clip in pair) for pair in second} != asked


def test_the_plan_of_a_choice_says_what_to_expect() -> None:
    first, second = plan(active(each=6, share=0.5))
    assert first.startswith("12 pairs; each participant makes 6 comparisons, 2 times each, 3 of them drawn")
    assert "each pair is compared 20.0 times on average" in second
    with pytest.raises(InputError, match="at least 3 comparisons to connect 4 items"):
        plan(active(each=1).model_copy(update={"participants": 2}))
