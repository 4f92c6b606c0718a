"""What a user wants otherwise: other means, other effect sizes."""

from collections.abc import Iterator, Sequence

from analysis.synthetic.published import (
    Direction,
    MarginLevels,
    PrintedMean,
    PrintedTest,
    Published,
    decimals,
)
from analysis.synthetic.space import DesignSpace
from experiments.errors import InputError


def with_wishes(
    published: Published, space: DesignSpace, means: Sequence[str], effects: Sequence[str]
) -> Published:
    """Replace published figures by wishes.

    Figures that would contradict a wish (the order and the pairs of its factors, a mean at the same place,
    the printed p of the same effect, the means of an effect wished away) are dropped; all others stay.

    Parameters
    ----------
    means : sequence of str
        `factor.level=4.80` (several levels joined by commas: `blur.MB,amplitude.FC=4.9`).
    effects : sequence of str
        `blur:amplitude=20.35`, the multivariate F wanted; `=0` for no effect.
    """
    wished_means = [_mean(text, space) for text in means]
    wished_tests = [_test(text, space) for text in effects]
    touched = [frozenset(m.at) for m in wished_means] + [frozenset(t.effect.split(":")) for t in wished_tests]
    if not touched:
        return published
    places = [m.at for m in wished_means]
    named = {t.effect for t in wished_tests}
    gone = [frozenset(t.effect.split(":")) for t in wished_tests if float(t.f or 1) == 0]
    update = {
        "means": (*_kept(published.means, places, gone), *wished_means),
        "tests": (
            *(t for t in published.tests if space.effect_called(t.effect) not in named),
            *wished_tests,
        ),
        "pairs": tuple(p for p in published.pairs if not any(p.factor in t for t in touched)),
        "directions": tuple(d for d in published.directions if not any(t & _factors(d) for t in touched)),
        "invented_means": tuple(
            m
            for m in published.invented_means
            if not any(set(m.at) <= set(p) for p in places) and not any(g <= set(m.at) for g in gone)
        ),
    }
    return published.model_copy(update=update)


def _kept(
    means: tuple[PrintedMean, ...], places: list[MarginLevels], gone: list[frozenset[str]]
) -> Iterator[PrintedMean]:
    """Printed means at no wished place, and not of an effect that is wished away."""
    for mean in means:
        if mean.at not in places and not any(effect <= set(mean.at) for effect in gone):
            yield mean


def _factors(direction: Direction) -> set[str]:
    places = (direction.higher, direction.lower, direction.order, direction.highest)
    return {factor for at in places if at for factor in at}


def _mean(text: str, space: DesignSpace) -> PrintedMean:
    place_text, sign, value = text.rpartition("=")
    parts = [part.strip().rpartition(".") for part in place_text.split(",")]
    if not sign or not all(factor and level for factor, _, level in parts):
        raise InputError(f"expected a mean as factor.level=4.80, got '{text}'")
    at = {factor: level for factor, _, level in parts}
    space.weights(at)
    number = _number(value, text)
    return PrintedMean(at=at, printed=f"{number:.{max(2, decimals(value.strip()))}f}")


def _test(text: str, space: DesignSpace) -> PrintedTest:
    name, sign, value = text.rpartition("=")
    if not sign:
        raise InputError(f"expected an effect as blur:amplitude=20.35 (its F), got '{text}'")
    number = _number(value, text)
    return PrintedTest(
        effect=space.effect_called(name.strip()), f=f"{number:.{max(2, decimals(value.strip()))}f}"
    )


def _number(value: str, text: str) -> float:
    try:
        number = float(value)
    except ValueError:
        raise InputError(f"expected a number after '=', got '{text}'") from None
    if not 0 <= number < 1e6:
        raise InputError(f"expected a number from 0 to a million after '=', got '{text}'")
    return number
