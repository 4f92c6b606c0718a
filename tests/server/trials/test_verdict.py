from dataclasses import replace

import pytest

from experiments.rules import PlaybackRules
from experiments.rules.playback import Disturbances
from server.participation.verdict import Playback, frames_in_log, is_settled, judge

CLIP = "a" * 64
GOOD = Playback(
    method="webcodecs",
    clip_sha256=CLIP,
    frames_drawn=45,
    frames_late=0,
    frames_missing=0,
    longest_gap_ms=34.0,
    focus_lost=False,
    frames_seen=45,
    refresh_rate_hz=60.0,
    clock_gap_ms=17.5,
    clock_late_ms=1.2,
)
FPS = 30


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({}, ("good", "")),
        ({"frames_missing": 1, "frames_seen": 44}, ("flagged", "flagged_missing_frames")),
        ({"frames_missing": 3, "frames_seen": 42}, ("flagged", "flagged_missing_frames")),
        ({"frames_missing": 4, "frames_seen": 41}, ("failed", "failed_missing_frames")),
        ({"frames_late": 2}, ("good", "")),
        ({"frames_late": 3}, ("flagged", "flagged_late_frames")),
        ({"longest_gap_ms": 70.5}, ("flagged", "flagged_longest_gap_ms")),
        ({"longest_gap_ms": 250.5}, ("failed", "failed_longest_gap_ms")),
        ({"focus_lost": True}, ("failed", "focus_lost")),
        ({"method": "video", "frames_seen": None}, ("flagged", "video_fallback")),
        ({"method": "none"}, ("failed", "clip_not_played")),
        ({"clip_sha256": "b" * 64}, ("failed", "wrong_clip")),
        ({"frames_seen": None}, ("flagged", "no_frame_log")),
        ({"frames_seen": 40}, ("flagged", "frame_log_disagrees")),
        ({"clock_gap_ms": None}, ("uncertain", "no_clock_record")),
        ({"clock_late_ms": None}, ("uncertain", "no_clock_record")),
        ({"clock_late_ms": 14.0}, ("good", "")),
        ({"clock_late_ms": 18.5}, ("uncertain", "uncertain_unevenness_ms")),
        ({"clock_gap_ms": 35.0}, ("uncertain", "uncertain_unevenness_ms")),
        ({"clock_gap_ms": 28.0, "refresh_rate_hz": 120.0}, ("good", "")),
        (
            {"clock_gap_ms": 35.0, "frames_missing": 1, "frames_seen": 44},
            ("flagged", "flagged_missing_frames"),
        ),
    ],
)
def test_the_declared_rules(change, expected) -> None:
    assert judge(PlaybackRules(), replace(GOOD, **change), CLIP, 45, FPS, rated=True) == expected


def test_a_play_without_a_rating_has_failed() -> None:
    assert judge(PlaybackRules(), GOOD, CLIP, 45, FPS, rated=False) == ("failed", "not_rated")


def test_lost_focus_may_be_declared_harmless_enough_to_flag() -> None:
    rules = PlaybackRules(fail_on_focus_lost=False, flag_video_fallback=False)
    assert judge(rules, replace(GOOD, focus_lost=True), CLIP, 45, FPS, rated=True) == (
        "flagged",
        "focus_lost",
    )
    assert judge(rules, replace(GOOD, method="video"), CLIP, 45, FPS, rated=True) == (
        "uncertain",
        "video_fallback",
    )


@pytest.mark.parametrize(
    "name", [name for name in Disturbances.model_fields if name not in ("focus_lost", "scale_reloaded")]
)
@pytest.mark.parametrize(
    ("consequence", "ruling"),
    [("ignore", "good"), ("flag", "flagged"), ("repeat", "failed"), (None, "flagged")],
)
def test_a_disturbance_does_what_is_declared(name: str, consequence: str | None, ruling: str) -> None:
    rules = PlaybackRules.model_validate({"disturbances": {name: consequence} if consequence else {}})
    verdict = judge(rules, replace(GOOD, disturbances={name: 1}), CLIP, 45, FPS, rated=True)
    assert verdict == (ruling, "" if ruling == "good" else name)


@pytest.mark.parametrize(
    ("declared", "ruling"),
    [({}, "failed"), ({"focus_lost": "flag"}, "flagged"), ({"focus_lost": "ignore"}, "good")],
)
def test_lost_focus_does_what_is_declared_like_the_others(declared: dict[str, str], ruling: str) -> None:
    rules = PlaybackRules.model_validate({"disturbances": declared})
    for changed in ({"focus_lost": True}, {"focus_lost": True, "disturbances": {"focus_lost": 2}}):
        assert judge(rules, replace(GOOD, **changed), CLIP, 45, FPS, rated=True)[0] == ruling


def test_an_unknown_disturbance_is_only_recorded_and_a_broken_view_always_fails() -> None:
    seen = replace(GOOD, disturbances={"model_config": 3, "later": 1})
    assert judge(PlaybackRules(), seen, CLIP, 45, FPS, rated=True) == ("good", "")
    broken = replace(GOOD, method="none", disturbances={"interrupted": 1})
    assert judge(PlaybackRules(), broken, CLIP, 45, FPS, rated=False) == ("failed", "interrupted")


def test_views_are_counted_one_by_one() -> None:
    assert frames_in_log([0, 1, 2, 2, 0, 1, 2]) == 6
    assert frames_in_log([]) == 0


@pytest.mark.parametrize(
    ("kind", "play", "verdict", "settled"),
    [
        ("main", 1, "good", True),
        ("main", 1, "flagged", True),
        ("main", 1, "failed", False),
        ("main", 2, "failed", True),
        ("practice", 1, "failed", True),
    ],
)
def test_only_failed_main_plays_are_repeated(kind: str, play: int, verdict: str, settled: bool) -> None:
    assert is_settled(kind, play, verdict, 1) is settled


@pytest.mark.parametrize(("fps", "refresh_rate_hz", "late_ms", "verdict"), [
    (24, 60.0, 14, "good"), (25, 60.0, 14, "good"), (30, 59.94, 17, "good"), (30, 60.0, 18.1, "uncertain"),
    (50, 60.0, 14.5, "good"), (60, 60.0, 14.5, "good"), (60, 59.9, 14.5, "good"), (60, None, 2, "good"),
    (50, 60.0, 15.1, "uncertain"), (60, 60.0, 15.1, "uncertain"), (60, None, 4, "uncertain"),
    (60, 144.0, 9, "good"), (60, 144.0, 9.3, "uncertain"),
    (120, 120.0, 7.4, "good"), (120, 120.0, 7.6, "uncertain"), (480, 480.0, 3.5, "uncertain"),
    (240, 240.0, 3.7, "good"), (240, 240.0, 4, "uncertain"),
    (480, 480.0, 1.8, "good"), (480, 480.0, 2, "uncertain"),
    (240, 480.0, 3.7, "good"), (240, 480.0, 3.8, "uncertain"), (60, 480.0, 13, "good"),
])  # fmt: skip
def test_a_frame_may_come_late_within_its_only_refresh_or_by_the_others(
    fps, refresh_rate_hz, late_ms, verdict
) -> None:
    refresh_ms = 1000 / (refresh_rate_hz or 60)
    for uneven in (
        {"clock_gap_ms": refresh_ms + late_ms},
        {"clock_gap_ms": refresh_ms, "clock_late_ms": late_ms},
    ):
        play = replace(GOOD, refresh_rate_hz=refresh_rate_hz, **uneven)
        assert judge(PlaybackRules(), play, CLIP, 45, fps, rated=True)[0] == verdict
