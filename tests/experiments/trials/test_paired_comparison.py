"""Pairs: which there are, who gets them, on which side; and what is refused."""

from collections import Counter
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments import design
from experiments.declaration.experiment import Experiment
from experiments.errors import InputError
from experiments.kinds.paired_comparison import assign, plan
from experiments.kinds.pairs import Deal, every_pair, groups
from experiments.load import FOLDER, DefinitionError, load_experiment, parse_experiment
from tests.experiments.trials.test_kinds import text_with

TRIAL = """\
[trial]
kind = "paired_comparison"
question = {{ en = "Which?", de = "Welcher?" }}
pairs = {pairs}
presentation = {{ arrangement = "{arrangement}"{more} }}
{rest}
"""


def declared(
    pairs: str = '{ among = "all" }',
    arrangement: str = "stacked",
    more: str = "",
    rest: str = "",
    per_cell: int = 2,
) -> Experiment:
    text = text_with(TRIAL.format(pairs=pairs, arrangement=arrangement, more=more, rest=rest))
    return parse_experiment(text.replace("per_cell = 20", f"per_cell = {per_cell}"))


def test_all_pairs_compare_the_same_exemplar_and_any_pairs_compare_every_two_clips() -> None:
    matched = every_pair(declared())
    assert len(matched) == 2 * 6
    assert all(pair.left.exemplar == pair.right.exemplar for pair in matched)
    every = every_pair(declared('{ among = "all", exemplars = "any" }'))
    assert len({frozenset(pair) for pair in every}) == len(every) == 8 * 7 // 2


def test_a_declared_list_gives_its_pairs_only() -> None:
    pairs = every_pair(
        declared(
            '{ among = "declared", cells = [{ cell = "both", other = "none" }, '
            '{ cell = "none", other = "vertical" }, { cell = "vertical", other = "horizontal" }] }'
        )
    )
    assert {frozenset((pair.left.cell, pair.right.cell)) for pair in pairs} == {
        frozenset(("both", "none")),
        frozenset(("none", "vertical")),
        frozenset(("vertical", "horizontal")),
    }


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32), people=st.integers(1, 9), each=st.integers(1, 30))
def test_each_pair_is_dealt_as_often_as_any_other_and_on_both_sides(
    seed: int, people: int, each: int
) -> None:
    experiment = declared(rest=f"pairs_per_person = {each}")
    times, sides = Counter[frozenset[object]](), Counter[object]()
    for slot in range(people):
        main = [trial for trial in assign(experiment, seed, slot) if trial.kind == "main"]
        assert len(main) == each * experiment.blocks.repeats
        for trial in main:
            by_role = {shown.role: shown.clip for shown in trial.shown}
            assert set(by_role) == {"left", "right"}
            times[frozenset(by_role.values())] += 1
            sides[by_role["left"], by_role["right"]] += 1
    counts = [times[frozenset(pair)] for pair in every_pair(experiment)]
    assert max(counts) - min(counts) <= experiment.blocks.repeats
    # Two blocks of the same pairs exchange the sides, so every pair is as often one way as the other.
    assert all(sides[pair] == sides[pair.swapped] for pair in every_pair(experiment))


def test_sides_are_as_even_for_each_clip_as_they_can_be() -> None:
    for per_cell in (1, 2, 3):
        pairs = every_pair(declared('{ among = "all", exemplars = "any" }', per_cell=per_cell))
        lead = Counter(pair.left for pair in pairs)
        lead.subtract(pair.right for pair in pairs)
        assert all(abs(surplus) <= 2 for surplus in lead.values())


def test_slots_in_turn_exchange_the_sides() -> None:
    deal = Deal(declared())
    for before, after in pairwise(map(deal.of_slot, range(4))):
        assert [pair.swapped for pair in before] == after


def test_clips_in_turn_are_first_and_second_with_a_reference_of_the_same_exemplar_before() -> None:
    experiment = declared(
        arrangement="one_after_the_other",
        more=", gap_ms = 300",
        rest='reference = { cell = "both", label = { en = "Reference", de = "Referenz" } }',
    )
    for trial in assign(experiment, 1, 0):
        assert [shown.role for shown in trial.shown] == ["first", "second", "reference"]
        first, _, reference = (shown.clip for shown in trial.shown)
        assert (reference.cell, reference.exemplar) == ("both", first.exemplar)
        assert reference in design.clips(experiment)


def test_the_plan_counts_pairs_and_clips() -> None:
    assert plan(declared()) == (
        "12 pairs; each participant makes 12 comparisons, 2 times each",
        "over 20 participants each pair is compared 40 times, each clip is in 120 comparisons",
    )


def test_a_disconnected_design_is_refused_at_plan_naming_the_groups() -> None:
    experiment = declared(
        '{ among = "declared", cells = [{ cell = "both", other = "none" }, '
        '{ cell = "vertical", other = "horizontal" }] }'
    )
    with pytest.raises(InputError, match=r"2 groups never .*\{both, none\} and \{horizontal, vertical\}"):
        plan(experiment)
    few = declared(rest="pairs_per_person = 1").model_copy(update={"participants": 2})
    with pytest.raises(InputError, match="groups never compared"):
        plan(few)


def test_groups_are_what_hangs_together() -> None:
    assert groups([("a", "b"), ("c", "b")], "abcd") == [["a", "b", "c"], ["d"]]


@pytest.mark.parametrize(
    ("pairs", "told"),
    [
        ('{ among = "within", factor = "lower_lit" }', "no factor is called 'lower_lit'; did you mean"),
        (
            '{ among = "declared", cells = [{ cell = "both", other = "both" }] }',
            "'both' is paired with itself",
        ),
        ('{ among = "declared", cells = [{ cell = "both", other = "non" }] }', "no cell is called 'non'"),
        ('{ among = "some" }', "no such among 'some'"),
    ],
)
def test_pairs_that_do_not_fit_are_named_with_their_line(pairs: str, told: str) -> None:
    with pytest.raises(DefinitionError, match=told) as raised:
        declared(pairs)
    line = raised.value.problems[0].line
    assert line is not None
    assert raised.value.problems[0].path.startswith("trial.pairs")


def test_neither_arrangement_is_chosen_silently() -> None:
    with pytest.raises(DefinitionError, match="if_too_narrow: this key is required"):
        declared(arrangement="side_by_side")
    assert declared(arrangement="side_by_side", more=', if_too_narrow = "stack"').trial


def test_the_demonstration_loads_and_hangs_together() -> None:
    demonstration = load_experiment(str(FOLDER / "pairs-demo.toml"))
    assert plan(demonstration)[0] == "12 pairs; each participant makes 12 comparisons"


def grouped(pairs: str = '{ among = "all" }', rest: str = "") -> Experiment:
    """The demonstration with its characters between participants."""
    text = (FOLDER / "pairs-demo.toml").read_text(encoding="utf-8")
    text = text.replace('label = "Character"\n', 'label = "Character"\nbetween = true\n', 1)
    return parse_experiment(
        text.replace('pairs = { among = "all", exemplars = "matched" }', f"pairs = {pairs}\n{rest}")
    )


def seen_by(experiment: Experiment, slot: int) -> set[str]:
    trials = assign(experiment, 1, slot)
    return {shown.clip.level("character") for trial in trials for shown in trial.shown}


@pytest.mark.parametrize(
    "rest",
    [
        "",
        "pairs_per_person = 1",
        'dealing = { by = "active" }\npairs_per_person = 2',
        'dealing = { by = "bibd", clips_per_block = 2 }',
    ],
)
def test_a_group_compares_its_own_clips_only(rest: str) -> None:
    experiment = grouped(rest=rest)
    seen = [seen_by(experiment, slot) for slot in range(6)]
    assert seen == [{"photorealistic"}, {"cartoon"}] * 3


def test_pairs_are_dealt_evenly_within_each_group() -> None:
    experiment = grouped(rest="pairs_per_person = 1")
    sides = Counter[object]()
    for slot in range(8):
        sides.update(
            tuple(shown.clip for shown in trial.shown)
            for trial in assign(experiment, slot, slot)
            if trial.kind == "main"
        )
    # Two groups of two pairs (one an exemplar), each with both sides.
    assert len(sides) == 8
    assert set(sides.values()) == {1}


def test_the_plan_counts_each_group_and_asks_for_connection_within_it_only() -> None:
    said = plan(grouped())
    assert said[0] == "2 groups of participants in turn: photorealistic (6), cartoon (6)"
    assert said[1] == "photorealistic: 2 pairs; each participant makes 2 comparisons"
    assert said[3].startswith("cartoon: 2 pairs")
    with pytest.raises(InputError, match="expected participants in every group, got none in 'cartoon'"):
        plan(grouped().model_copy(update={"participants": 1}))


@pytest.mark.parametrize(
    ("pairs", "told"),
    [
        ('{ among = "within", factor = "character" }', "nobody sees two of its levels"),
        (
            '{ among = "declared", cells = [{ cell = "cartoon/model", other = "photorealistic/model" }] }',
            "are seen by different groups",
        ),
    ],
)
def test_pairs_across_groups_are_refused(pairs: str, told: str) -> None:
    with pytest.raises(DefinitionError, match=told):
        grouped(pairs)


def test_a_reference_has_the_level_of_the_participants_group() -> None:
    experiment = grouped(rest='reference = { cell = "cartoon/model", label = { en = "R", de = "R" } }')
    for slot, character in enumerate(("photorealistic", "cartoon")):
        shown = assign(experiment, 1, slot)[-1].shown[-1]
        assert (shown.role, shown.clip.cell) == ("reference", f"{character}/model")
