"""Levels that were read from names are in the order that a reader expects."""

import pytest

from experiments.own_clips import in_order, levels_from_names, levels_of


@pytest.mark.parametrize(
    "expected",
    [
        "-1.5 2 10", "0.5 1 1.5", "2ms 10ms", "dur-100 dur-1000", "slow medium fast", "Slow Normal Fast",
        "none low medium high", "none some all", "small medium large", "XS S M L", "never sometimes always",
        "very_low low very_high", "bad poor fair good excellent", "young middle-aged old", "before after",
        "off on", "baseline weak strong",
    ],
)  # fmt: skip
def test_numbers_and_words_of_scales_have_their_order(expected: str) -> None:
    levels = expected.split()
    assert in_order(sorted(levels)) == levels
    assert in_order(levels[::-1] * 2) == levels


@pytest.mark.parametrize(
    "levels", [["robot", "human"], ["slow", "banana"], ["nan", "1"], ["2ms", "10s"], ["none"]]
)
def test_other_levels_stay_as_they_came(levels: list[str]) -> None:
    assert in_order(levels) == levels


def test_every_factor_of_file_names_is_in_order() -> None:
    files = sorted(
        f"{speed}_{tilt}.mp4" for speed in ("fast", "medium", "slow") for tilt in ("-1.5", "10", "2")
    )
    placed = levels_from_names("{speed}_{tilt}.mp4", files)
    assert levels_of(placed) == {"speed": ["slow", "medium", "fast"], "tilt": ["-1.5", "2", "10"]}
