"""Who sees which clips: groups, balanced samples and lists, over any number of participants."""

import hashlib
import random
from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments import design
from experiments.assignment.groups import clips_of, groups, seat_of
from experiments.assignment.order import ordered_blocks
from experiments.assignment.shares import expected_counts, list_label, share
from experiments.declaration.experiment import Experiment
from experiments.kinds import trials_per_participant
from experiments.kinds.clip_rating import CLIP_RATING
from experiments.load import DefinitionError, load_experiment, locate, parse_experiment
from experiments.schema.canonical import definition_sha256
from experiments.schema.difference import difference

EXP1 = locate("exp1").read_text(encoding="utf-8")
people = st.integers(min_value=1, max_value=60)
relaxed = settings(deadline=None, max_examples=25)


def exp1(assignment: str = "", between: tuple[str, ...] = (), split: bool = False) -> Experiment:
    text = EXP1 if split else EXP1.replace('split_by = "character"\n', "")
    for name in between:
        text = text.replace(f'name = "{name}"\nlabel', f'name = "{name}"\nbetween = true\nlabel')
    return parse_experiment(f"{text}\n[assignment]\n{assignment}\n")


BETWEEN = exp1("clips_per_cell = 7", ("character", "amplitude"))


@relaxed
@given(st.integers(min_value=1, max_value=20), people)
def test_over_any_number_of_people_clip_counts_differ_by_one_at_most(per_cell: int, people: int) -> None:
    counts = expected_counts(exp1(f"clips_per_cell = {per_cell}"), range(people))
    assert max(counts.values()) - min(counts.values()) <= 1
    assert sum(counts.values()) == people * per_cell * 16


@relaxed
@given(people)
def test_groups_are_of_one_size_and_each_sees_its_clips_equally_often(people: int) -> None:
    sizes = Counter(seat_of(BETWEEN, slot).levels for slot in range(people))
    assert max(sizes.values()) - min(sizes[group] for group in groups(BETWEEN)) <= 1
    counts = expected_counts(BETWEEN, range(people))
    for slot in range(4):
        own = [counts[clip] for clip in clips_of(BETWEEN, seat_of(BETWEEN, slot))]
        assert max(own) - min(own) <= 1


@relaxed
@given(st.integers(min_value=0, max_value=2**53 - 1), st.integers(min_value=0, max_value=500))
def test_a_participant_meets_their_share_in_trials_and_practice(seed: int, slot: int) -> None:
    trials = CLIP_RATING.assign(BETWEEN, seed, slot)
    main = [trial.clip for trial in trials if trial.kind == "main"]
    mine = share(BETWEEN, seat_of(BETWEEN, slot))
    assert len(main) == len(set(main)) == trials_per_participant(BETWEEN) == 28
    assert set(main) == mine
    assert {clip.level("character") for clip in mine} == {dict(seat_of(BETWEEN, slot).levels)["character"]}
    practised = {trial.clip.cell for trial in trials if trial.kind == "practice" and trial.clip}
    assert practised <= {clip.cell for clip in mine}


def test_a_sample_shows_the_same_exemplars_in_every_cell() -> None:
    for slot in range(8):
        mine = share(BETWEEN, seat_of(BETWEEN, slot))
        by_cell = {cell: {c.exemplar for c in mine if c.cell == cell} for cell in {c.cell for c in mine}}
        assert len({frozenset(numbers) for numbers in by_cell.values()}) == 1


def test_lists_are_dealt_in_turn() -> None:
    lists = [["cartoon/real/MB/FC/1", "cartoon/model/MB/FC/1"], ["cartoon/real/MB/FC/2"]]
    experiment = exp1(f"lists = {lists}")
    shown = [len(share(experiment, seat_of(experiment, slot))) for slot in range(4)]
    assert shown == [2, 1, 2, 1]
    assert "317 clips are never shown" in CLIP_RATING.plan(experiment)[-1]


def test_declared_blocks_hold_their_part_of_the_share() -> None:
    experiment = exp1("clips_per_cell = 5", ("blur",), split=True)
    trials = [trial for trial in CLIP_RATING.assign(experiment, 3, 1) if trial.kind == "main"]
    assert Counter(trial.block_label for trial in trials) == {"photorealistic": 20, "cartoon": 20}
    assert all(trial.clip and trial.clip.level("character") == trial.block_label for trial in trials)


def test_the_plan_says_groups_and_counts() -> None:
    first, second = CLIP_RATING.plan(exp1("clips_per_cell = 5", ("character",)))
    assert first == "2 groups of participants in turn: photorealistic (16), cartoon (16)"
    assert second == "with 32 participants, each clip is seen 4 times"
    assert CLIP_RATING.plan(load_experiment("exp1")) == ()


@pytest.mark.parametrize(
    ("assignment", "between", "split", "message"),
    [
        ("clips_per_cell = 21", (), False, "expected at most 20, the number of clips per cell; got 21"),
        (
            "clips_per_cell = 2\nlists = [['a/1']]",
            (),
            False,
            "expected `clips_per_cell` or `lists`, got both; remove one of them",
        ),
        ("lists = [['a', 'a']]", (), False, "list 1: expected each clip once, got 'a' twice"),
        ("lists = [['cartoon/real/MB/FC/21']]", (), False, "list 1: the design has no clip"),
        ("lists = [['cartoon/real/MB/FC/1']]", ("blur",), False, "'blur' already makes groups"),
        (
            "",
            ("character",),
            True,
            "'character' differs between participants; split by a within-participant factor",
        ),
    ],
)
def test_what_does_not_fit_is_said_in_one_line(
    assignment: str, between: tuple[str, ...], split: bool, message: str
) -> None:
    with pytest.raises(DefinitionError) as raised:
        exp1(assignment, between, split)
    assert message in str(raised.value)
    assert raised.value.problems[0].line


def test_both_are_measured_and_leave_other_hashes_alone() -> None:
    plain = parse_experiment(EXP1.replace('split_by = "character"\n', ""))
    assert definition_sha256(exp1()) == definition_sha256(plain)
    for other in (exp1("clips_per_cell = 5"), exp1(between=("blur",))):
        assert definition_sha256(other) != definition_sha256(plain)
        assert {change.effect for change in difference(plain, other)} == {"measured"}
    assert design.clips(exp1("clips_per_cell = 5")) == design.clips(plain)


SHARES = {
    "exp1": "f92b990d6dd25482",
    "exp2": "9b20b60374644f2c",
    "exp3": "cd24344362be47f6",
    "a sample": "f7df58bb07afaac3",
    "a sample in blocks": "844efc31a2cbd8f5",
    "lists": "2d4523e709726255",
}
"""SHA-256 of who sees what in which blocks; written by `digest` of the first deal of samples."""

STUDIES = {
    **{name: load_experiment(name) for name in ("exp1", "exp2", "exp3")},
    "a sample": BETWEEN,
    "a sample in blocks": parse_experiment(
        EXP1.replace('order = "random"', 'order = "alternating"', 1) + "\n[assignment]\nclips_per_cell = 7\n"
    ),
    "lists": exp1("lists = [['cartoon/real/MB/FC/1'], ['cartoon/real/MB/FC/2']]"),
}


def digest(experiment: Experiment) -> str:
    """Hash of the shares and orders of blocks of 40 slots."""
    sha = hashlib.sha256()
    for slot in range(40):
        seat = seat_of(experiment, slot)
        blocks = [block.label for block in ordered_blocks(experiment, random.Random(slot), seat.number)]
        sha.update(repr((sorted(map(list_label, share(experiment, seat))), blocks)).encode())
    return sha.hexdigest()[:16]


@pytest.mark.parametrize("name", STUDIES)
def test_who_sees_what_stays_where_no_factor_is_dealt(name: str) -> None:
    assert digest(STUDIES[name]) == SHARES[name]
