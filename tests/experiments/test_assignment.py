from collections import Counter
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments import design
from experiments.assignment.incomplete_blocks import block_orders
from experiments.declaration.experiment import Experiment
from experiments.kinds.clip_rating import assign
from experiments.load import load_experiment, parse_experiment
from tests.helpers.studies import SHORT

seeds = st.integers(min_value=0, max_value=2**53 - 1)
slots = st.integers(min_value=0, max_value=1000)
relaxed = settings(deadline=None, max_examples=25)


def with_blocks(**blocks: Any) -> Experiment:
    experiment = parse_experiment(SHORT)
    return experiment.model_copy(update={"blocks": experiment.blocks.model_copy(update=blocks)})


def labels(experiment: Experiment, seed: int, slot: int) -> list[str]:
    """Block labels in the order a participant meets them."""
    seen = {trial.block: trial.block_label for trial in assign(experiment, seed, slot) if trial.block}
    return [seen[block] for block in sorted(seen)]


@relaxed
@given(st.sampled_from(["exp1", "exp2", "exp3"]), seeds, slots)
def test_every_participant_meets_every_clip_as_often_as_declared(name: str, seed: int, slot: int) -> None:
    experiment = load_experiment(name)
    main = Counter(trial.clip for trial in assign(experiment, seed, slot) if trial.kind == "main")
    declared = Counter(clip for block in design.blocks(experiment) for clip in block.clips)
    assert main == declared


@relaxed
@given(seeds, slots)
def test_same_seed_and_slot_give_the_same_order(seed: int, slot: int) -> None:
    experiment = parse_experiment(SHORT)
    assert assign(experiment, seed, slot) == assign(experiment, seed, slot)


def test_different_seeds_give_different_orders() -> None:
    experiment = load_experiment("exp3")
    orders = {tuple(trial.clip for trial in assign(experiment, seed, 0)) for seed in range(200)}
    assert len(orders) == 200


@relaxed
@given(seeds, slots)
def test_a_block_holds_one_level_of_its_factor(seed: int, slot: int) -> None:
    for trial in assign(load_experiment("exp2"), seed, slot):
        if trial.kind == "main" and trial.clip is not None:
            assert trial.clip.level("character") == trial.block_label


def test_alternating_blocks_cycle_from_a_start_dealt_by_slot() -> None:
    experiment = load_experiment("exp2")
    assert labels(experiment, 1, 0) == ["photorealistic", "cartoon"] * 2
    assert labels(experiment, 1, 1) == ["cartoon", "photorealistic"] * 2


def test_fixed_blocks_keep_the_declared_order() -> None:
    experiment = with_blocks(order="fixed")
    assert {tuple(labels(experiment, seed, seed)) for seed in range(20)} == {("a", "b")}


def test_random_blocks_come_in_every_order() -> None:
    experiment = with_blocks(order="random")
    assert {tuple(labels(experiment, seed, 0)) for seed in range(40)} == {("a", "b"), ("b", "a")}


def test_counterbalanced_orders_are_dealt_evenly() -> None:
    experiment = with_blocks(order="counterbalanced")
    dealt = Counter(tuple(labels(experiment, slot, slot)) for slot in range(10))
    assert dealt == {("a", "b"): 5, ("b", "a"): 5}


@pytest.mark.parametrize("count", [6, 7])
def test_many_blocks_follow_a_latin_square(count: int) -> None:
    experiment = parse_experiment(SHORT)
    factor = experiment.factors[0]
    levels = tuple(factor.levels[0].model_copy(update={"name": f"l{number}"}) for number in range(count))
    factors = (factor.model_copy(update={"levels": levels}), *experiment.factors[1:])
    blocks = experiment.blocks.model_copy(update={"order": "counterbalanced"})
    orders = block_orders(experiment.model_copy(update={"factors": factors, "blocks": blocks}))
    for place in range(count):
        assert len(set(Counter(order[place] for order in orders).values())) == 1
    after = Counter(pair for order in orders for pair in pairwise(order))
    assert len(after) == count * (count - 1)
    assert len(set(after.values())) == 1


def test_fixed_trial_order_keeps_the_design() -> None:
    experiment = with_blocks(order="fixed", trial_order="fixed")
    shown = [trial.clip for trial in assign(experiment, 5, 0) if trial.kind == "main"]
    assert shown == [clip for block in design.blocks(experiment) for clip in block.clips]


@relaxed
@given(seeds)
def test_practice_comes_first_from_different_cells(seed: int) -> None:
    experiment = load_experiment("exp1")
    trials = assign(experiment, seed, 0)
    practice = trials[: experiment.practice.trials]
    assert {trial.kind for trial in practice} == {"practice"}
    assert len({trial.clip.cell for trial in practice if trial.clip}) == experiment.practice.trials
    assert all(trial.kind != "practice" for trial in trials[len(practice) :])


@relaxed
@given(seeds)
def test_each_block_has_its_attention_checks_never_first(seed: int) -> None:
    experiment = parse_experiment(SHORT)
    trials = assign(experiment, seed, 0)
    checks = [trial for trial in trials if trial.kind == "attention"]
    assert Counter(trial.block for trial in checks) == {1: 1, 2: 1}
    assert all(trial.clip is None and 1 <= (trial.expected_response or 0) <= 7 for trial in checks)
    first = {block: next(trial for trial in trials if trial.block == block) for block in (1, 2)}
    assert all(trial.kind == "main" for trial in first.values())
