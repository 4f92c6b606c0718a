"""Motion checks: what may be answered, and whether their clip was shown; studies of every kind have them."""

from collections.abc import Mapping

from experiments.checks import CHECK_KINDS
from experiments.trials.check import CheckAnswer
from server.errors import Invalid
from server.trials.kinds import answer_of
from server.trials.schemas import RatingIn
from server.trials.several_clips import playback_of
from server.trials.verdict import Ruling
from server.trials.verdict import judge as judge_play
from server.versions import LoadedVersion


class NoSuchChoice(Invalid):
    """The check has no such choice."""

    code = "no_such_choice"


class NoOtherWay(Invalid):
    """The study offers no way around its checks."""

    code = "no_other_way"


def validate(loaded: LoadedVersion, clips: Mapping[str, int], rating: RatingIn) -> None:
    """Refuse an answer of another kind, a choice that is not offered, and a way around that is not."""
    answer = answer_of(rating, CheckAnswer)
    choices = len(CHECK_KINDS[loaded.check_of(clips["shown"]).check].choices)
    if answer.check is not None and answer.check > choices:
        raise NoSuchChoice(f"Expected a choice from 1 to {choices}, got {answer.check}.")
    if answer.other_way and loaded.experiment.evidence.motion_checks.other_way is None:
        raise NoOtherWay("Expected one of the choices; this study offers no other way.")


def judge(loaded: LoadedVersion, clips: Mapping[str, int], rating: RatingIn) -> Ruling:
    """The verdict on the play of the check's clip."""
    clip = loaded.clips[clips["shown"]]
    playback = playback_of(rating.playback)
    rated = rating.answer.given
    return judge_play(loaded.experiment.playback, playback, clip.sha256, clip.frames, clip.fps, rated=rated)
