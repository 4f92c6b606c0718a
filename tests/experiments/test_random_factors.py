"""Random factors: faces as items, of which each participant sees some, and what is refused."""

from collections import Counter
from itertools import combinations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.assignment.groups import seat_of
from experiments.assignment.incomplete_blocks import balanced_blocks
from experiments.assignment.shares import expected_counts, share, turn_of_last
from experiments.declaration.experiment import Experiment
from experiments.kinds import trials_per_participant
from experiments.kinds.clip_rating import CLIP_RATING
from experiments.load import DefinitionError, parse_experiment
from experiments.schema.difference import difference
from tests.helpers.faces import DEMO, faces

relaxed = settings(deadline=None, max_examples=25)


def seen_faces(experiment: Experiment, slot: int) -> frozenset[str]:
    return frozenset(clip.level("face") for clip in share(experiment, seat_of(experiment, slot)))


@relaxed
@given(st.integers(2, 8), st.data())
def test_each_sees_k_faces_and_any_two_faces_meet_equally_often(number: int, data: st.DataObject) -> None:
    seen = data.draw(st.integers(1, number - 1))
    experiment = faces(number, seen)
    around = number if seen == 1 else len(balanced_blocks(number, seen) or ())
    laps = [seen_faces(experiment, slot) for slot in range(around)]
    assert {len(those) for those in laps} == {seen}
    once = Counter(face for those in laps for face in those)
    assert len(once) == number
    assert len(set(once.values())) == 1
    if seen > 1:
        pairs = Counter(two for those in laps for two in combinations(sorted(those), 2))
        assert len(pairs) == number * (number - 1) // 2
        assert len(set(pairs.values())) == 1


def test_exemplars_are_dealt_apart_from_faces() -> None:
    """Both go round in circles of a common length; yet every face is met with every exemplar."""
    experiment = faces(3, 1, "\n[assignment]\nclips_per_cell = 1\n")
    counts = expected_counts(experiment, range(9))
    assert set(counts.values()) == {1}


LIGHTS = "".join(f'[[factors.levels]]\nname = "l{k}"\nlabel = "L{k}"\n' for k in range(3))
LIGHT = f'\n[[factors]]\nname = "light"\nlabel = "Light"\nrandom = true\nper_participant = 1\n{LIGHTS}'


def test_two_dealt_factors_and_exemplars_meet_in_every_combination() -> None:
    experiment = faces(3, 1, f"{LIGHT}\n[assignment]\nclips_per_cell = 1\n")
    counts = expected_counts(experiment, range(27))
    assert len(counts) == 3 * 3 * 3 * 3
    assert set(counts.values()) == {1}


@relaxed
@given(st.lists(st.integers(1, 9), min_size=3, max_size=3))
def test_any_circles_meet_in_every_combination_once(lengths: list[int]) -> None:
    """Of three circles of any lengths all three, hence each two, once in as many seats as combinations."""
    first, second, third = lengths
    met: Counter[tuple[int, ...]] = Counter()
    for seat in range(2 * first * second * third):
        met[tuple(turn_of_last(seat, lengths[:k]) % lengths[k - 1] for k in (1, 2, 3))] += 1
    assert len(met) == first * second * third
    assert set(met.values()) == {2}


@pytest.mark.parametrize("order", ["alternating", "counterbalanced", "fixed"])
def test_faces_meet_every_order_of_blocks(order: str) -> None:
    experiment = faces(4, 2, f'\n[blocks]\nsplit_by = "profile"\norder = "{order}"\n')
    met: Counter[tuple[object, ...]] = Counter()
    for slot in range(72):
        trials = CLIP_RATING.assign(experiment, 1, slot)
        labels = tuple(dict.fromkeys(trial.block_label for trial in trials if trial.kind == "main"))
        met[labels, seen_faces(experiment, slot)] += 1
    assert len(met) == 6 * {"alternating": 3, "counterbalanced": 6, "fixed": 1}[order]
    assert len(set(met.values())) == 1


@relaxed
@given(st.integers(0, 2**53 - 1), st.integers(0, 200))
def test_trials_and_practice_show_the_faces_of_the_share(seed: int, slot: int) -> None:
    experiment = faces(4, 2)
    trials = CLIP_RATING.assign(experiment, seed, slot)
    shown = {trial.clip.level("face") for trial in trials if trial.clip}
    main = [trial for trial in trials if trial.kind == "main"]
    assert shown == seen_faces(experiment, slot)
    assert len(main) == trials_per_participant(experiment) == 2 * 3 * 3


def test_a_plan_says_how_many_faces_each_sees() -> None:
    first, second = CLIP_RATING.plan(faces(4, 2))
    assert first == "each participant sees 2 of 4 levels of 'face'"
    assert second.startswith("with 12 participants, each clip is seen 6 times")


@pytest.mark.parametrize(
    ("keys", "seen", "more", "message"),
    [
        ("", 2, "", "per_participant applies to random factors"),
        ("random = true", 5, "", "expected at most the 4 levels, got 5"),
        ("random = true\nbetween = true", None, "", "`random` or `between`, got both"),
        (
            "random = true",
            2,
            '\n[blocks]\nsplit_by = "face"\n',
            "participants see only some levels of 'face'",
        ),
        (
            "random = true",
            2,
            "\n[assignment]\nlists = [['f0/SL/1']]\n",
            "'face' is already assigned by per_participant",
        ),
    ],
)
def test_what_does_not_fit_is_said_in_one_line(keys: str, seen: int, more: str, message: str) -> None:
    with pytest.raises(DefinitionError) as raised:
        faces(4, seen, more, keys)
    assert message in str(raised.value)


def test_a_random_factor_is_not_compared() -> None:
    text = DEMO.replace('factors = ["profile"]', 'factors = ["face", "profile"]')
    with pytest.raises(DefinitionError, match="'face' is a random factor, over which ratings are averaged"):
        parse_experiment(text)


def test_what_is_seen_is_measured_and_what_is_random_is_wording() -> None:
    plain = faces(4, None)
    assert {change.effect for change in difference(plain, faces(4, None, keys="random = false"))} == {
        "wording"
    }
    assert {change.effect for change in difference(plain, faces(4, 2))} == {"measured"}
