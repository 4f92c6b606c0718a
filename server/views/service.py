"""Store views once each: what began is known though the page dies, what ended carries its frames."""

from datetime import datetime

from sqlalchemy.orm import Session

from server.errors import Conflict
from server.models import StudyRun, View, ViewClip
from server.trials.refusals import ConsentMissing
from server.trials.service import TrialNotInRun
from server.views import repository
from server.views.frame_log import packed, unpacked
from server.views.schemas import SeenClip, ViewIn, ViewsIn, ViewsSaved, ViewState


class ViewDiffers(Conflict):
    """Another view is stored under this id, or with this number."""

    code = "view_differs"


def save_views(session: Session, run: StudyRun, sent: ViewsIn, moment: datetime) -> ViewsSaved:
    """Begin and complete views of a locked run, all of them or none.

    Also after the run's end, since the page sends late.
    """
    if run.consented_at is None:
        raise ConsentMissing("Nothing is stored before the participant has agreed; send the consent first.")
    trials = {view.trial_index for view in sent.views}
    if unknown := trials - repository.trial_indices(session, run, trials):
        raise TrialNotInRun(
            f"Trial {min(unknown)} is not in this run, which has trials 0 to {run.trials_total - 1}."
        )
    known = {view.view_id: view for view in repository.stored(session, run, trials)}
    numbers = {(view.trial_index, view.number): view.view_id for view in known.values()}
    _refuse_others(sent, known, numbers)
    run.last_seen_at = moment
    begun = completed = 0
    for view in sent.views:
        row = known.get(str(view.id))
        if row is None:
            row = known[str(view.id)] = _begin(session, run, view, moment)
            begun += 1
        if (view.outcome or view.ended_at_client) and not row.completed:
            _complete(session, row, view)
            completed += 1
    return ViewsSaved(begun=begun, completed=completed, saved_at=moment)


def _refuse_others(sent: ViewsIn, known: dict[str, View], numbers: dict[tuple[int, int], str]) -> None:
    for view in sent.views:
        ident, place = str(view.id), (view.trial_index, view.number)
        row = known.get(ident)
        if numbers.setdefault(place, ident) != ident or (row and (row.trial_index, row.number) != place):
            raise ViewDiffers(
                f"View {view.number} of trial {view.trial_index} is stored under another id, or this id is "
                "that of another view; the first is kept."
            )


def _begin(session: Session, run: StudyRun, view: ViewIn, moment: datetime) -> View:
    row = View(
        view_id=str(view.id),
        study_run_id=run.id,
        trial_index=view.trial_index,
        number=view.number,
        play=view.play or view.number,
        started_at_client=view.started_at_client,
        received_at=moment,
        screen=view.screen,
        completed=False,
    )
    repository.add(session, row)
    return row


def _complete(session: Session, row: View, view: ViewIn) -> None:
    row.ended_at_client, row.completed, row.outcome = view.ended_at_client, True, view.outcome
    row.disturbances = dict(view.disturbances)
    if view.showings is not None:
        row.showings = [showing.model_dump() for showing in view.showings]
    clips = {clip.role: clip for clip in view.clips}
    repository.add_clips(
        session,
        [
            ViewClip(view=row.id, role=role, clip_sha256=clip.clip_sha256, frame_log=packed(clip.drawn))
            for role, clip in clips.items()
        ],
    )


def unanswered_views(session: Session, run: StudyRun) -> dict[int, list[ViewState]]:
    """The views of each trial that were begun for a play without an answer yet, in their order."""
    waiting = repository.unanswered(session, run)
    clips = repository.clips_of(session, waiting)
    found: dict[int, list[ViewState]] = {}
    for view in waiting:
        found.setdefault(view.trial_index, []).append(_state(view, clips.get(view.id, [])))
    return found


def _state(view: View, clips: list[ViewClip]) -> ViewState:
    return ViewState.model_validate(
        {
            "id": view.view_id,
            "number": view.number,
            "play": view.play,
            "started_at_client": view.started_at_client,
            "ended": view.completed,
            "outcome": view.outcome,
            "showings": view.showings,
            "clips": [
                SeenClip.model_validate(
                    {"role": clip.role, "clip_sha256": clip.clip_sha256, "drawn": unpacked(clip.frame_log)}
                )
                for clip in clips
            ],
            "disturbances": view.disturbances,
        }
    )
