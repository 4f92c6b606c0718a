"""The pattern that is suggested for the names of own clips."""

import pytest

from experiments.errors import InputError
from experiments.kinds import reserved_names
from experiments.own_clips import levels_from_names, levels_from_table, suggest_pattern


@pytest.mark.parametrize(
    ("names", "pattern"),
    [
        (["fast_sad_1.mp4", "fast_happy_1.mp4", "slow_sad_2.mp4"], "{speed}_{emotion}_{exemplar}.mp4"),
        (["blink_slow_1.mp4", "blink_fast_2.mp4"], "blink_{speed}_{exemplar}.mp4"),
        (["blink_100.mp4", "blink_200.mp4"], "blink_{factor1}.mp4"),
        (["blink_slow_1.mp4", "blink_fast_1.mp4"], "blink_{speed}_1.mp4"),
        (["Ärm_x.mp4", "Örm_x.mp4"], "{factor1}_x.mp4"),
        (
            ["speed-slow_arm-left_1.mp4", "speed-fast_arm-right_2.mp4"],
            "speed-{speed}_arm-{arm}_{exemplar}.mp4",
        ),
        (["rosie_dur100_take1.mp4", "hal_dur200_take2.mp4"], "{factor1}_dur{dur}_take{exemplar}.mp4"),
        (["slow-left-1.mp4", "fast-right-2.mp4"], "{speed}-{side}-{exemplar}.mp4"),
        (["slow_fast.mp4", "fast_slow.mp4"], "{speed}_{factor2}.mp4"),
        (["cell-a_x.mp4", "cell-b_y.mp4"], "{factor1}_{factor2}.mp4"),
        (["happy_item-cup.mp4", "sad_item-ball.mp4"], "{emotion}_item-{item}.mp4"),
        (["happy_v0.5.mp4", "sad_v1.mp4"], "{emotion}_v{v}.mp4"),
        (["happy_v1.mp4", "sad_v2.mp4"], "{emotion}_v{exemplar}.mp4"),
        (["factor2-a_xx.mp4", "factor2-b_qq.mp4"], "factor2-{factor2}_{factor3}.mp4"),
        (["ours.mp4", "baseline.mp4", "mocap.mp4"], "{system}.mp4"),
        (["ours_1.mp4", "mocap_1.mp4", "ours_2.mp4", "mocap_2.mp4"], "{system}_{exemplar}.mp4"),
        (["dur60.mp4", "dur90.mp4", "dur180.mp4"], "dur{dur}.mp4"),
        (["dur60ms.mp4", "dur180ms.mp4"], "dur{dur}ms.mp4"),
        (["face_dur60ms_1.mp4", "face_dur180ms_1.mp4"], "face_dur{dur}ms_1.mp4"),
        (["speed=slow.mp4", "speed=fast.mp4"], "speed={speed}.mp4"),
        (["left.mp4", "right.mp4"], "{side}.mp4"),
        (["alpha.mp4", "beta.mp4"], "{factor1}.mp4"),
        (["60.mp4", "90.mp4"], "{factor1}.mp4"),
        (["clip1.mp4", "clip2.mp4"], None),
        (["take01.mov", "take02.mov"], None),
        (["one.mp4"], None),
        (["one_1.mp4"], None),
        (["a_1.mp4", "b.mp4"], None),
    ],
)
def test_parts_that_vary_are_factors(names: list[str], pattern: str | None) -> None:
    assert suggest_pattern(names) == pattern
    if pattern is not None:
        assert set(levels_from_names(pattern, names)) == set(names)


@pytest.mark.parametrize("name", ["method", "value", "kind", "position", "series", "reference"])
def test_a_factor_with_the_name_of_a_column_is_refused_as_soon_as_it_is_read(name: str) -> None:
    with pytest.raises(InputError, match=f"'{name}'.*'{name}_shown'"):
        levels_from_names(f"{{{name}}}_{{exemplar}}.mp4", ["a_1.mp4"])
    with pytest.raises(InputError, match=f"'{name}'.*'{name}_shown'"):
        levels_from_table(f"file,{name}\na_1.mp4,a\n", ["a_1.mp4"])


def test_no_suggested_name_is_one_of_a_column() -> None:
    for name in sorted(reserved_names() - {"exemplar"}):
        pattern = suggest_pattern([f"{name}-a_1.mp4", f"{name}-b_1.mp4"])
        assert pattern is not None
        assert f"{{{name}}}" not in pattern


def test_an_ending_is_not_a_part_of_a_level_as_the_page_shows_it() -> None:
    placed = levels_from_names("{speed}_{style}", ["fast_round.mp4", "slow_flat.webm"])
    assert [levels for levels, _ in placed.values()] == [
        {"speed": "fast", "style": "round"},
        {"speed": "slow", "style": "flat"},
    ]


def test_an_ending_can_be_a_field() -> None:
    placed = levels_from_names("{speed}.{format}", ["fast.mp4", "slow.mp4"])
    assert [levels["format"] for levels, _ in placed.values()] == ["mp4", "mp4"]
