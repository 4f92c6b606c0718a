"""Levels that can be recognized by something other than the factor are named; chance is not."""

from collections import Counter

import numpy as np
import pytest
from scipy.stats import chi2, chi2_contingency

from experiments.level_leaks import (
    chi_square_tail,
    level_leaks,
    pearson_statistic,
    reported_leaks,
)
from experiments.manifest import Clip


def clip(number: int, levels: dict[str, str], **values: object) -> Clip:
    """A clip of somebody's own, each with different bytes."""
    return Clip.model_validate(
        {
            "levels": levels, "cell": "/".join(levels.values()), "exemplar": 1, "file": "a.mp4",
            "sha256": f"{number:064x}", "bytes": 1000 + number, "fps": 30.0, "frames": 40, "width_px": 640,
            "height_px": 360,
        } | values
    )  # fmt: skip


def clips_with(**by_level: list[dict[str, object]]) -> list[Clip]:
    """Clips of a factor `method`: for each level the values of its clips."""
    return [
        clip(1000 * k + n, {"method": level}, **values)
        for k, (level, of_level) in enumerate(by_level.items())
        for n, values in enumerate(of_level)
    ]


LEAKS: dict[str, tuple[str, list[dict[str, object]], list[dict[str, object]]]] = {
    "rest after the blink": (
        "step from first to last position of the lid",
        [{"closure": (0.0, 1.0, 0.0)}] * 12,
        [{"closure": (0.0, 1.0, 0.01 + 0.01 * n)} for n in range(12)],
    ),
    "lower lid that stays displaced": (
        "last position of the lower lid (slide)",
        [{"closure": (0.0, 0.0), "lower_horizontal_mm": (0.0, 0.0)}] * 12,
        [{"closure": (0.0, 0.0), "lower_horizontal_mm": (0.0, 0.02 + 0.01 * n)} for n in range(12)],
    ),
    "length": (
        "number of frames",
        [{"frames": 30 + n} for n in range(12)],
        [{"frames": 60 + n} for n in range(12)],
    ),
    "size": ("picture size", [{"width_px": 640}] * 2, [{"width_px": 642}] * 2),
    "rate": ("frame rate", [{"fps": 25.0}] * 2, [{"fps": 30.0}] * 2),
}


def test_one_level_of_a_small_set_at_another_rate_is_named() -> None:
    usual = {level: [{}] * 2 for level in "abc"}
    (found,) = reported_leaks(clips_with(**usual, smooth=[{"fps": 60.0}] * 2))
    assert "'smooth'" in found
    assert "frame rate" in found


@pytest.mark.parametrize("name", LEAKS)
def test_a_level_that_something_else_gives_away_is_named(name: str) -> None:
    feature, first, second = LEAKS[name]
    found = reported_leaks(clips_with(ours=first, baseline=second))
    assert any(feature in sentence for sentence in found), found
    assert all("'method'" in sentence for sentence in found)


def test_one_level_of_several_is_named_for_it() -> None:
    rng = np.random.default_rng(1)
    rests = {level: [{"closure": (0.0, float(x))} for x in rng.uniform(0.02, 0.2, 10)] for level in "abc"}
    (found,) = reported_leaks(clips_with(**rests, model=[{"closure": (0.0, 0.0)}] * 10))[:1]
    assert "'model'" in found


def test_brightness_that_a_decoder_measured_counts_too() -> None:
    clips = clips_with(ours=[{}] * 6, baseline=[{}] * 6)
    measured = {one.sha256: 100.0 + 5 * (one.levels["method"] == "ours") for one in clips}
    assert reported_leaks(clips) == []
    (found,) = reported_leaks(clips, {"brightness of the first frame": measured})
    assert "brightness of the first frame" in found


def test_the_size_of_files_is_tabulated_and_never_reported() -> None:
    clips = clips_with(ours=[{"bytes": 10}] * 6, baseline=[{"bytes": 90}] * 6)
    assert [leak.p_value for leak in level_leaks(clips) if leak.feature == "size of the file"] == [0.0]
    assert reported_leaks(clips) == []


def test_chance_is_reported_about_as_rarely_as_promised() -> None:
    rng = np.random.default_rng(2)
    reported = 0
    for study in range(400):
        clips = [
            clip(n, {"a": "xyz"[n % 3], "b": "pq"[n % 2]}, frames=int(frames), closure=(0.0, float(end)))
            for n, (frames, end) in enumerate(
                zip(rng.integers(30, 60, 60), rng.uniform(0, 0.2, 60), strict=True)
            )
        ]
        del study
        reported += len(reported_leaks(clips))
    assert reported <= 12  # 400 studies x 2 factors x 3 features x 0.001 are 2.4


def test_the_same_blink_in_several_cells_is_one_observation() -> None:
    clips = [
        clip(
            100 * n + k,
            {"profile": "ab"[n % 2], "blur": blur},
            profile=f"p{n}",
            exemplar=n + 1,
            frames=30 + n,
        )
        for n in range(6)
        for k, blur in enumerate(["x", "y", "z", "w"])
    ]
    (leak,) = (
        one for one in level_leaks(clips) if (one.factor, one.feature) == ("profile", "number of frames")
    )
    assert leak.clips == 6
    assert not leak.reported


def test_a_factor_of_rendered_clips_may_vary_what_it_declares() -> None:
    def rendered(n: int, duration: str, character: str, frames: int) -> Clip:
        return clip(
            n, {"duration": duration, "character": character}, frames=frames, duration_frames=float(duration),
            inputs={"character": character}, width_px=640 if character == "a" else 642, onset_frame=10,
        )  # fmt: skip

    clips = [
        rendered(40 * k + 20 * j + n, duration, character, 30 + 3 * int(duration) + n)
        for k, duration in enumerate(["7", "13"])
        for j, character in enumerate("ab")
        for n in range(8)
    ]
    assert reported_leaks(clips) == []


def test_the_statistic_and_its_tail_are_those_of_scipy() -> None:
    rng = np.random.default_rng(3)
    for levels, groups in [(2, 2), (3, 4), (5, 5)]:
        counts = rng.integers(1, 20, (levels, groups))
        table = {str(k): Counter(dict(enumerate(row.tolist()))) for k, row in enumerate(counts)}
        statistic, df = pearson_statistic(table)
        expected = chi2_contingency(counts, correction=False)
        assert (statistic, df) == (pytest.approx(expected.statistic), expected.dof)
    for df in (1, 2, 4, 12, 40):
        for p in (0.05, 0.01, 0.001):
            assert chi_square_tail(float(chi2.isf(p, df)), df) == pytest.approx(p, rel=1e-9)


def test_lids_that_rest_lower_for_their_settle_are_set_on_purpose() -> None:
    drawn = {"character": "cartoon"}
    plain: dict[str, object] = {"closure": (0.0, 0.0), "inputs": drawn}
    settling: dict[str, object] = {"closure": (0.08, 0.08), "inputs": drawn | {"settle": "1.0"}}
    assert reported_leaks(clips_with(plain=[plain] * 12, settling=[settling] * 12)) == []
    undeclared = settling | {"inputs": drawn}
    assert reported_leaks(clips_with(plain=[plain] * 12, settling=[undeclared] * 12)) != []
