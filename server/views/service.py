"""Store views once each: what began is known though the page dies, what ended carries its frames."""

from sqlalchemy.orm import Session

from server.clock import now
from server.errors import Conflict
from server.models import StudyRun, View, ViewClip
from server.participants.lookup import find_run
from server.trials.refusals import ConsentMissing
from server.trials.service import TrialNotInRun
from server.views import repository
from server.views.frame_log import packed
from server.views.schemas import ViewIn, ViewsIn, ViewsSaved


class ViewDiffers(Conflict):
    """Another view is stored under this id, or with this number."""

    code = "view_differs"


def save_views(session: Session, token: str, sent: ViewsIn) -> ViewsSaved:
    """Begin and complete views, all of them or none; also after the run's end, since the page sends late."""
    run = find_run(session, token, lock=True)
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
    moment = run.last_seen_at = now()
    begun = completed = 0
    for view in sent.views:
        row = known.get(str(view.id))
        if row is None:
            row = known[str(view.id)] = _begin(session, run, view)
            begun += 1
        if view.ended_at_client is not None and not row.completed:
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


def _begin(session: Session, run: StudyRun, view: ViewIn) -> View:
    row = View(
        view_id=str(view.id),
        study_run_id=run.id,
        trial_index=view.trial_index,
        number=view.number,
        started_at_client=view.started_at_client,
        screen=view.screen,
        completed=False,
    )
    repository.add(session, row)
    return row


def _complete(session: Session, row: View, view: ViewIn) -> None:
    row.ended_at_client, row.completed = view.ended_at_client, True
    clips = {clip.role: clip for clip in view.clips}
    repository.add_clips(
        session,
        [
            ViewClip(view=row.id, role=role, clip_sha256=clip.clip_sha256, frame_log=packed(clip.drawn))
            for role, clip in clips.items()
        ],
    )
