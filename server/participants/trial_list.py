"""A run's trials as the page gets them: in stored order, with what is still to be shown of each."""

from typing import Any

from sqlalchemy.orm import Session

from experiments.checks import CheckName
from experiments.trials import KINDS
from server.models import StudyRun
from server.participants import repository
from server.trials.repository import refused_trials
from server.trials.schemas import SeriesPosition, TrialClip, TrialInfo
from server.trials.series import service as series
from server.trials.verdict import is_settled
from server.versions import LoadedVersion, PlacedClip
from server.views.repository import numbers
from server.views.service import unanswered_views

_TOLD = ("clip_sha256", "frames", "fps")
_SIZE = ("width_px", "height_px", "width_mm", "inter_ocular_px")


def trial_list(session: Session, run: StudyRun, loaded: LoadedVersion) -> list[TrialInfo]:
    """Every trial of a run; nothing in it tells the participant which cell a clip is of."""
    done, begun = repository.plays(session, run), numbers(session, run)
    unanswered = unanswered_views(session, run) if begun else {}
    max_repeats = loaded.experiment.playback.max_repeats
    positions = _positions(session, run, loaded)
    refused = refused_trials(session.connection(), run.id)
    shown, clips = loaded.once(_FirstClips), loaded.once(_Clips)
    trials = []
    for row in repository.trials(session, run):
        index, kind, first = row.trial_index, row.kind, next(iter(row.clips.values()), None)
        plays = done.get(index, ())
        settled = any(is_settled(kind, play, verdict, max_repeats) for play, verdict in plays)
        position, closed = positions.get(index, (None, False))
        settled = settled or closed or index in refused
        trials.append(
            TrialInfo(
                trial_index=index,
                kind=kind,
                block=row.block,
                **shown[first],
                clips=[clips[role, clip] for role, clip in row.clips.items()],
                prompt=_prompt(loaded, run.language, row) if kind == "attention" else None,
                check=_check(loaded, first) if kind == "check" else None,
                plays_done=len(plays),
                plays_wanted=len(plays) if settled else len(plays) + 1,
                answered=settled,
                series=position,
                views_begun=begun.get(index, 0),
                views=[] if settled else unanswered.get(index, []),
            )
        )
    return trials


def _positions(
    session: Session, run: StudyRun, loaded: LoadedVersion
) -> dict[int, tuple[SeriesPosition, bool]]:
    """Position in its series of each trial that has one, and whether that series ended before it."""
    if not KINDS[loaded.experiment.trial.kind].adapts:
        return {}
    return {
        index: (SeriesPosition(number=number, position=position, known=known), closed)
        for index, number, position, known, closed in series.places(session.connection(), run.id, loaded)
    }


class _FirstClips(dict[int | None, dict[str, Any]]):
    """What a trial tells of its first clip, by the clip's id; under None the nulls of a trial without clips.

    As with `_Clips`: made when a clip is first shown, and kept with its version, which never changes.
    """

    def __init__(self, loaded: LoadedVersion) -> None:
        super().__init__({None: dict.fromkeys((*_TOLD, *_SIZE))})
        self.loaded = loaded

    def __missing__(self, ident: int) -> dict[str, Any]:
        clip = self.loaded.clips[ident]
        told = {name: getattr(clip, name) for name in _SIZE if name != "inter_ocular_px"}
        self[ident] = _told(clip) | told | {"inter_ocular_px": self.loaded.inter_ocular_px}
        return self[ident]


class _Clips(dict[tuple[str, int], TrialClip]):
    """Every clip of a version as the page gets it, by role and id."""

    def __init__(self, loaded: LoadedVersion) -> None:
        super().__init__()
        self.loaded = loaded

    def __missing__(self, shown: tuple[str, int]) -> TrialClip:
        role, ident = shown
        self[shown] = TrialClip.model_validate({"role": role, **_told(self.loaded.clips[ident])})
        return self[shown]


def _told(clip: PlacedClip) -> dict[str, Any]:
    return {"clip_sha256": clip.sha256, "frames": clip.frames, "fps": clip.fps}


def _check(loaded: LoadedVersion, clip: int | None) -> CheckName | None:
    return None if clip is None else loaded.check_of(clip).check


def _prompt(loaded: LoadedVersion, language: str, row: repository.StoredTrial) -> str:
    """What an attention check asks for; the right answer of a motion check is never told."""
    texts = loaded.experiment.attention.text
    text = texts.get(language) or texts.get("en") or next(iter(texts.values()))
    return text.replace("{response}", str(row.expected_response))
