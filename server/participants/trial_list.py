"""A run's trials as the page gets them: in stored order, with what is still to be shown of each."""

from typing import Any

from sqlalchemy.orm import Session

from experiments.checks import CheckName
from experiments.trials import KINDS
from server.models import StudyRun
from server.participants import repository
from server.trials.schemas import SeriesPlace, TrialClip, TrialInfo
from server.trials.series import service as series
from server.trials.verdict import is_settled
from server.versions import LoadedVersion
from server.views.repository import numbers
from server.views.service import unanswered_views


def trial_list(session: Session, run: StudyRun, loaded: LoadedVersion) -> list[TrialInfo]:
    """Every trial of a run; nothing in it tells the participant which cell a clip is of."""
    done, clips = repository.plays(session, run), repository.trial_clips(session, run)
    begun, unanswered = numbers(session, run), unanswered_views(session, run)
    most = loaded.experiment.playback.max_repeats
    places = _places(session, run, loaded)
    trials = []
    for row in repository.trials(session, run):
        shown = clips.get(row.trial_index, {})
        first = next(iter(shown.values()), None)
        clip = loaded.clips[first] if first is not None else None
        plays = done.get(row.trial_index, [])
        settled = any(is_settled(row.kind, play, verdict, most) for play, verdict in plays)
        place, closed = places.get(row.trial_index, (None, False))
        settled = settled or closed
        trials.append(
            TrialInfo(
                trial_index=row.trial_index,
                kind=row.kind,
                block=row.block,
                clip_sha256=clip.sha256 if clip else None,
                clip_url=f"/clips/{clip.sha256}.mp4" if clip else None,
                frames=clip.frames if clip else None,
                fps=clip.fps if clip else None,
                bytes=clip.bytes if clip else None,
                width_px=clip.width_px if clip else None,
                height_px=clip.height_px if clip else None,
                width_mm=clip.width_mm if clip else None,
                inter_ocular_px=loaded.inter_ocular_px if clip else None,
                clips=[_clip(loaded, role, clip_id) for role, clip_id in shown.items()],
                prompt=_prompt(loaded, run.language, row),
                check=_check(loaded, first) if row.kind == "check" else None,
                plays_done=len(plays),
                plays_wanted=len(plays) if settled else len(plays) + 1,
                answered=settled,
                series=place,
                views_begun=begun.get(row.trial_index, 0),
                views=[] if settled else unanswered.get(row.trial_index, []),
            )
        )
    return trials


def _places(session: Session, run: StudyRun, loaded: LoadedVersion) -> dict[int, tuple[SeriesPlace, bool]]:
    """Place in its series of each trial that has one, and whether that series ended before it."""
    if not KINDS[loaded.experiment.trial.kind].adapts:
        return {}
    return {
        index: (SeriesPlace(number=number, position=position, known=known), closed)
        for index, number, position, known, closed in series.places(session.connection(), run.id, loaded)
    }


def _clip(loaded: LoadedVersion, role: str, clip_id: int) -> TrialClip:
    clip = loaded.clips[clip_id]
    return TrialClip.model_validate(
        {
            "role": role,
            "clip_sha256": clip.sha256,
            "clip_url": f"/clips/{clip.sha256}.mp4",
            "frames": clip.frames,
            "fps": clip.fps,
            "width_px": clip.width_px,
            "height_px": clip.height_px,
            "width_mm": clip.width_mm,
            "inter_ocular_px": loaded.inter_ocular_px,
        }
    )


def _check(loaded: LoadedVersion, clip: int | None) -> CheckName | None:
    return None if clip is None else loaded.check_of(clip).check


def _prompt(loaded: LoadedVersion, language: str, row: Any) -> str | None:
    """What an attention check asks for; the right answer of a motion check is never told."""
    if row.kind != "attention":
        return None
    texts = loaded.experiment.attention.text
    text = texts.get(language) or texts.get("en") or next(iter(texts.values()))
    return text.replace("{response}", str(row.expected_response))
