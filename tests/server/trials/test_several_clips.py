import pytest

from experiments.rules import PlaybackRules
from server.participation.answer_schemas import RatingIn
from server.participation.verdict import judge_several
from server.participation.versions import PlacedClip

SLOW, FAST = "a" * 64, "b" * 64


def _clip(sha256: str, fps: float) -> PlacedClip:
    return PlacedClip(sha256, frames=30, fps=fps, bytes=1, width_px=8, height_px=8, width_mm=None)


def _rating(late_ms: float) -> RatingIn:
    shown = {"frames_drawn": 30, "frames_missing": 0}
    playback = {
        "method": "webcodecs",
        "clips": {"first": {"clip_sha256": SLOW, **shown}, "second": {"clip_sha256": FAST, **shown}},
        "frames_drawn": 60,
        "frames_late": 0,
        "frames_missing": 0,
        "longest_gap_ms": 34.0,
        "refresh_rate_hz": 60.0,
        "clock_gap_ms": 17.0,
        "clock_late_ms": late_ms,
        "drawn": [(frame, frame * 33.3) for frame in range(30)] * 2,
    }
    answer = {"kind": "paired_comparison", "winner": "left", "arrangement": "one_after_the_other"}
    return RatingIn.model_validate({"trial_index": 0, "answer": answer, "playback": playback})


@pytest.mark.parametrize(("late_ms", "verdict"), [(14, "good"), (16, "uncertain")])
@pytest.mark.parametrize("slow_first", [True, False])
def test_clips_of_several_rates_are_judged_by_the_greatest(
    late_ms: float, verdict: str, slow_first: bool
) -> None:
    roles = [("first", _clip(SLOW, 30)), ("second", _clip(FAST, 60))]
    assigned = dict(roles if slow_first else reversed(roles))
    assert judge_several(PlaybackRules(), assigned, 60, _rating(late_ms))[0] == verdict
