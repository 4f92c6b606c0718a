"""What programs find in a check's clip as it is delivered: nothing in pictures, everything in their motion.

Seeds are fixed, so that a measurement is the same in every run; limits are about four standard errors of
a mean over `CLIPS` clips (0.013 measured) around chance.
"""

import numpy as np
import pytest
from numpy.typing import NDArray

from experiments.checks import CheckName
from stimuli_builder.checks.jobs import DOT_PX, CheckJob, pictures
from stimuli_builder.clips.encode import encode_clip
from tests.stimuli_builder.checks import solvers

CLIPS = 16
CHANCE, LIMIT = 0.5, 0.06
FIRST_SEED = 20_261_122
GREY = (126, 128, 128)
ALONE = ("frame", "mean")


def job(check: CheckName, number: int, difficulty: float = 0.3) -> CheckJob:
    return CheckJob(check, number, FIRST_SEED + number, difficulty, 0.6, 1.2, 30, GREY)


@pytest.fixture(scope="module")
def delivered() -> list[tuple[CheckJob, NDArray[np.float64]]]:
    """Clips of digits and shapes in turn, decoded from the bytes that a participant gets."""
    kinds: tuple[CheckName, ...] = ("digit", "shape")
    jobs = [job(kinds[number % 2], number) for number in range(1, CLIPS + 1)]
    return [(one, solvers.decoded(one.render())) for one in jobs]


def looked_at(clip: NDArray[np.float64], what: str, number: int) -> NDArray[np.float64]:
    if what == "mean":
        return np.asarray(clip.mean(0))
    return clip[int(np.random.default_rng(number).integers(len(clip)))]


def in_pixels(one: CheckJob) -> NDArray[np.bool_]:
    return one.motion.mask.repeat(DOT_PX, 0).repeat(DOT_PX, 1)


@pytest.mark.parametrize("what", ALONE)
@pytest.mark.parametrize("look", solvers.LOOKS)
def test_no_look_at_a_picture_or_at_the_mean_shows_what_is_inside(
    delivered: list[tuple[CheckJob, NDArray[np.float64]]], what: str, look: str
) -> None:
    """Against the masks of other clips of the same kind, so that the edge of the picture says nothing."""
    differences = []
    for number, (one, clip) in enumerate(delivered):
        ranked = solvers.ranks(solvers.LOOKS[look](looked_at(clip, what, number)))
        own = solvers.area_under_curve(ranked, in_pixels(one))
        others = [
            solvers.area_under_curve(ranked, in_pixels(other))
            for other, _ in delivered
            if other.check == one.check and other.number != one.number
        ]
        differences.append(own - float(np.mean(others)))
    assert CHANCE + float(np.mean(differences)) == pytest.approx(CHANCE, abs=LIMIT)


def test_motion_shows_what_is_inside(delivered: list[tuple[CheckJob, NDArray[np.float64]]]) -> None:
    areas = []
    for one, clip in delivered:
        fields = solvers.flow_fields(clip)
        there = one.motion.way - 1
        score = solvers.uniform_filter(fields[there] - fields[there ^ 1], 5)
        ranked = solvers.ranks(score.repeat(DOT_PX, 0).repeat(DOT_PX, 1))
        areas.append(solvers.area_under_curve(ranked, in_pixels(one)))
    assert min(areas) > 0.97


@pytest.mark.parametrize("what", ALONE)
def test_a_solver_that_knows_every_shape_fails_at_chance_on_pictures(
    delivered: list[tuple[CheckJob, NDArray[np.float64]]], what: str
) -> None:
    """It passes by what it may get right with a probability below 1 in 1,000 where it guesses."""
    looks = ("edges", "local_contrast", "coding_noise")
    for look in looks:
        right = 0
        for number, (one, clip) in enumerate(delivered):
            seen = solvers.LOOKS[look](looked_at(clip, what, number))
            right += solvers.best_template(one, solvers.on_lattice(seen)) == one.answer
        chances = [1 / 9 if one.check == "digit" else 1 / 4 for one, _ in delivered]
        assert at_least(right, chances) > 0.001, f"{look}: {right} of {len(delivered)} right"


def test_a_solver_that_computes_optical_flow_passes(
    delivered: list[tuple[CheckJob, NDArray[np.float64]]],
) -> None:
    """As docs/explanation/evidence.md says: such a program is not stopped by these checks."""
    right = [solvers.answer_by_flow(one, clip) == one.answer for one, clip in delivered]
    assert sum(right) >= 0.9 * len(right)
    ways = [job("direction", number, 1.0) for number in range(1, 9)]
    assert all(solvers.answer_by_flow(one, solvers.decoded(one.render())) == one.answer for one in ways)


def test_coding_adds_nothing_to_a_picture_that_depends_on_the_others() -> None:
    """The same picture is decoded the same whatever comes before and after it."""
    rng = np.random.default_rng(3)
    size = (48, 48)
    drawn = [rng.integers(16, 236, (72, 48)).astype(np.uint8) for _ in range(4)]
    orders = ([0, 1, 2], [3, 1, 0], [1, 1, 3])
    clips = [
        solvers.decoded(encode_clip([drawn[k] for k in order], size, 30, alone_qp=16)) for order in orders
    ]
    assert (clips[0][1] == clips[1][1]).all()
    assert (clips[0][1] == clips[2][0]).all()
    assert (clips[0][1] == clips[2][1]).all()


def test_the_mean_of_what_is_drawn_is_the_background_everywhere() -> None:
    one = job("digit", 5)
    assert (pictures(one.motion, np.random.default_rng(1)).mean(0) == 0.5).all()


def test_a_file_s_size_says_nothing_of_the_answer() -> None:
    sizes: dict[int, list[int]] = {}
    for number in range(1, 25):
        one = CheckJob("shape", number, 99, 0.3, 0.6, 1.2, 30, GREY)
        sizes.setdefault(one.answer, []).append(len(one.render()))
    every = [size for group in sizes.values() for size in group]
    between = np.std([np.mean(group) for group in sizes.values()])
    expected = np.std(every) / np.sqrt(np.mean([len(group) for group in sizes.values()]))
    assert between < 3 * expected


def at_least(right: int, chances: list[float]) -> float:
    """The probability that guesses with these chances are right at least so often (Poisson-binomial)."""
    distribution = [1.0]
    for chance in chances:
        hit, missed = [0.0, *distribution], [*distribution, 0.0]
        distribution = [(1 - chance) * a + chance * b for a, b in zip(missed, hit, strict=True)]
    return sum(distribution[right:])
