"""Store views once each: what a view must bring along, and its frames, packed."""

import base64
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from sqlalchemy import Connection
from sqlalchemy.orm import Session

from experiments.kinds import KINDS
from server.core.errors import ApiError, Conflict
from server.core.values import hash_token
from server.models import StudyRun, View, ViewClip
from server.participation import evidence_repository, view_repository
from server.participation.answer_schemas import (
    IMPOSSIBLE,
    SeenClip,
    ViewEvidence,
    ViewIn,
    ViewsIn,
    ViewsSaved,
    ViewState,
)
from server.participation.intake import Intake, check_ticket, milliseconds, too_short
from server.participation.refusals import (
    ClipsOutlastTickets,
    ConsentMissing,
    RunUnknown,
    TicketMissing,
    TrialNotInRun,
)
from server.participation.versions import LoadedVersion, Versions
from server.participation.view_repository import RunOfViews, StoredView, TrialClips

# The log of drawn frames, packed: differences from entry to entry as numbers of few bytes, in base64.
#
# An entry is a frame's index and its time in ms; times are kept to 0.01 ms. The text form keeps it readable
# for backups and either database.

PER_MS = 100
"""Steps of time per millisecond."""
Entry = tuple[int, float]


def pack_log(log: Iterable[Entry]) -> str:
    """A log as text."""
    out, frame_before, time_before = bytearray(), 0, 0
    for frame, ms in log:
        time = round(ms * PER_MS)
        _add(out, frame - frame_before)
        _add(out, time - time_before)
        frame_before, time_before = frame, time
    return base64.b64encode(out).decode("ascii")


def unpack_log(text: str) -> list[Entry]:
    """The log that `pack_log` made a text of."""
    numbers, entries, frame, time = _numbers(base64.b64decode(text)), [], 0, 0
    # Two numbers per entry: the step of the frame, then that of its time.
    for step in numbers:
        frame, time = frame + step, time + next(numbers)
        entries.append((frame, time / PER_MS))
    return entries


def _add(out: bytearray, number: int) -> None:
    """Append a number: its sign in the lowest bit, then seven bits per byte with a bit for `more`."""
    rest = 2 * number if number >= 0 else -2 * number - 1
    while rest > 0x7F:
        out.append(rest & 0x7F | 0x80)
        rest >>= 7
    out.append(rest)


def _numbers(content: bytes) -> Iterator[int]:
    rest, shift = 0, 0
    for byte in content:
        rest |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80:
            yield -(rest + 1) // 2 if rest & 1 else rest // 2
            rest, shift = 0, 0


# What a view must bring along to be stored: the ticket of its play, and time enough.


@dataclass(frozen=True)
class ArrivingView:
    """One view as it begins or ends.

    Attributes
    ----------
    clip_ms : float
        How long it lasts, 0 unless it was shown to its end.
    given_at : datetime
        By the client's clock.
    """

    trial_index: int
    play: int
    clip_ms: float
    given_at: datetime
    evidence: ViewEvidence | None


@dataclass(frozen=True)
class Arrival:
    """Views of one run that came together.

    Attributes
    ----------
    needs_tickets : bool
        Its page brings them with every view.
    """

    run: int
    run_id: str
    origin: str
    needs_tickets: bool
    received_at: datetime
    views: Sequence[ArrivingView]


# Decision 0700: Views carry tickets.
def take_views(intake: Intake, connection: Connection, arrival: Arrival) -> list[datetime | None]:
    """When the ticket of each view was issued; refused by name where one cannot have begun or ended so.

    None without a ticket, as pages send views that were open before they had any, and where nothing is
    refused and the ticket does not hold.
    """
    issued: list[datetime | None] = []
    before = _EarlierViews(connection, arrival.run)
    for view in arrival.views:
        try:
            issued.append(_issued_at(intake, arrival, view, before))
        except ApiError as refusal:
            if intake.enforces(arrival.origin):
                intake.note(connection, arrival, refusal, evidence_repository.VIEW)
                raise
            # Kept as a view without a ticket: where nothing is refused, what was shown still counts as
            # shown.
            issued.append(None)
    return issued


@dataclass
class _EarlierViews:
    """The run's views before one of an arrival: those stored, and `shown`, which came with it.

    Attributes
    ----------
    shown : list of (datetime, float)
        Issue and length of each.
    """

    connection: Connection
    run: int
    shown: list[tuple[datetime, float]] = field(default_factory=list)
    _spent: dict[datetime, evidence_repository.ViewTime] = field(default_factory=dict)

    def spent(self, since: datetime) -> evidence_repository.ViewTime:
        """What those stored took: read once a time, since none is stored while an arrival is looked at."""
        if since not in self._spent:
            self._spent[since] = evidence_repository.spent_by_views(self.connection, self.run, since)
        return self._spent[since]


def _issued_at(
    intake: Intake, arrival: Arrival, view: ArrivingView, before: _EarlierViews
) -> datetime | None:
    """When the ticket of a view was issued; the view is added to those `before` the next."""
    given = view.evidence
    if given is None:
        if arrival.needs_tickets:
            raise TicketMissing("Expected a ticket with the view, got none; please reload the page.")
        return None
    # The earlier of both moments, so that a device's clock in the future cannot age a ticket.
    where = (arrival.run_id, view.trial_index, view.play, min(arrival.received_at, view.given_at))
    issued_at = check_ticket(intake.key, given.batch, given.ticket, *where).issued_at
    if view.clip_ms > 0:
        before.shown.append((issued_at, view.clip_ms))
        _in_time(arrival.received_at, issued_at, before)
    return issued_at


def _in_time(received_at: datetime, issued_at: datetime, before: _EarlierViews) -> None:
    """ClipsOutlastTickets where the views of a batch, or of the run, cannot have been shown by now."""
    spent, shown = before.spent(issued_at), before.shown
    first = min(filter(None, (spent.first_issued_at, *(moment for moment, _ in shown))))
    of_batch = spent.batch_ms + sum(ms for moment, ms in shown if moment >= issued_at)
    of_run = spent.run_ms + sum(ms for _, ms in shown)
    # Twice, as for answers (`intake._in_time`): neither a reload nor a second batch makes more time.
    for since, needed in ((issued_at, of_batch), (first, of_run)):
        there_was = milliseconds(received_at - since)
        if too_short(needed, there_was):
            raise ClipsOutlastTickets(
                f"Clips of {needed / 1000:.1f} s cannot have been shown in the {there_was / 1000:.1f} s "
                "since their tickets were issued; nothing is stored.",
                needed_ms=needed,
                there_was_ms=there_was,
            )


# Store views once each: what began is known though the page dies, what ended carries its frames.


class ViewDiffers(Conflict, code="view_differs"):
    """Another view is stored under this id, or with this number."""


def save_views(
    versions: Versions, intake: Intake, connection: Connection, token: str, sent: ViewsIn, moment: datetime
) -> ViewsSaved:
    """Begin and complete views of a run, all of them or none.

    Also after the run's end, since the page sends late.
    """
    run = view_repository.run_of_views(connection, hash_token(token))
    if run is None:
        raise RunUnknown(
            "This visit is not known; please open the link you were given again.",
            headers={"www-authenticate": "Bearer"},
        )
    if run.consented_at is None:
        raise ConsentMissing("Nothing is stored before the participant has agreed; send the consent first.")
    # Looked up once for all that came: up to 100 views arrive together after a time offline.
    known = {view.view_id: view for view in _known_views(connection, run, sent)}
    numbers = {(view.trial_index, view.number): view.view_id for view in known.values()}
    _refuse_others(sent, known, numbers)
    news = [view for view in sent.views if _says_more(view, known.get(str(view.id)))]
    clip_ms = _clip_ms(connection, versions.get(connection, run.version_id), run, news)
    issued = _tickets(intake, connection, run, news, clip_ms, moment)
    view_repository.mark_seen(connection, run.id, moment)
    begun = completed = 0
    for view, issued_at, length in zip(news, issued, clip_ms, strict=True):
        ident = str(view.id)
        # A view may begin and end in one delivery, as after a time offline.
        row = known.get(ident) or StoredView(ident, view.trial_index, view.number, completed=False)
        if ident not in known:
            view_repository.begin(connection, _new_view_row(run, view, moment, issued_at))
            begun += 1
        if _ends(view) and not row.completed:
            _complete(connection, run, view, length)
            row = row._replace(completed=True)
            completed += 1
        known[ident] = row
    return ViewsSaved(begun=begun, completed=completed, saved_at=moment)


def _known_views(connection: Connection, run: RunOfViews, sent: ViewsIn) -> Iterable[StoredView]:
    """The stored views of the trials that these are of; TrialNotInRun where the run has no such trial."""
    for trial in sorted({view.trial_index for view in sent.views}):
        stored = view_repository.stored_views(connection, run.id, trial)
        if stored is None:
            raise TrialNotInRun(
                f"Trial {trial} is not in this run, which has trials 0 to {run.trials_total - 1}."
            )
        yield from stored


def _refuse_others(sent: ViewsIn, known: dict[str, StoredView], numbers: dict[tuple[int, int], str]) -> None:
    for view in sent.views:
        ident, position = str(view.id), (view.trial_index, view.number)
        row = known.get(ident)
        if numbers.setdefault(position, ident) != ident or (
            row and (row.trial_index, row.number) != position
        ):
            raise ViewDiffers(
                f"View {view.number} of trial {view.trial_index} is stored under another id, or this id is "
                "that of another view; the first is kept."
            )


def _ends(view: ViewIn) -> bool:
    return bool(view.outcome or view.ended_at_client)


def _says_more(view: ViewIn, row: StoredView | None) -> bool:
    """Whether anything of a view is to be stored; what the outbox sends again is not looked at."""
    return row is None or (_ends(view) and not row.completed)


def _clip_ms(
    connection: Connection, loaded: LoadedVersion, run: RunOfViews, views: Sequence[ViewIn]
) -> list[float]:
    """How long each view lasts that was shown to its end, 0 for others.

    As its kind shows the clips of a trial: at once or in turn, with what is between. A view does not become
    shorter for naming others. Where answers decide on clips, they are those that it names of all that were
    chosen for the trial, since others may have been since.
    """
    shown = [view for view in views if _shows(view, run)]
    trials = {view.trial_index for view in shown}
    clips = {trial: view_repository.clips_of_trial(connection, run.id, trial) for trial in trials}
    chosen: dict[int, dict[str, float]] = {}
    if KINDS[loaded.experiment.trial.kind].adapts:
        chosen = {
            trial: _lengths(loaded, view_repository.clips_chosen(connection, run.id, trial))
            for trial in trials
        }
    return [
        _length(loaded, view, clips[view.trial_index], chosen.get(view.trial_index, {}))
        if _shows(view, run)
        else 0.0
        for view in views
    ]


def _shows(view: ViewIn, run: RunOfViews) -> bool:
    """Whether a view was shown to its end; pages that bring tickets with views say so of each that ended."""
    untold = view.outcome is None and view.ended_at_client is not None
    # Such a page names every outcome: a view without one is taken as shown, since that is what takes
    # time.
    return view.outcome == "shown" or (run.view_tickets and untold)


def _lengths(loaded: LoadedVersion, clips: Iterable[int]) -> dict[str, float]:
    """How long clips last, by their hashes."""
    hashes = (loaded.clips[ident].sha256 for ident in clips)
    return {sha256: loaded.lengths[sha256] for sha256 in hashes}


def _length(loaded: LoadedVersion, view: ViewIn, clips: TrialClips, chosen: Mapping[str, float]) -> float:
    """A view's length in ms: of the clips it names that were chosen for the trial, else of its own."""
    named: dict[str, str] = {clip.role: clip.clip_sha256 for clip in view.clips}
    own = {role: loaded.clips[ident].sha256 for role, ident in clips.by_role.items()}
    lengths = {role: chosen.get(named.get(role, ""), loaded.lengths[sha256]) for role, sha256 in own.items()}
    return max(lengths.values()) if clips.is_check else loaded.experiment.trial.view_ms(lengths)


def _tickets(
    intake: Intake,
    connection: Connection,
    run: RunOfViews,
    views: Sequence[ViewIn],
    clip_ms: Sequence[float],
    moment: datetime,
) -> list[datetime | None]:
    """When the ticket of each view was issued; None without one."""
    if run.evidence != "asked":
        return [None] * len(views)
    arriving = [
        ArrivingView(
            view.trial_index,
            view.play or view.number,
            length,
            view.ended_at_client or view.started_at_client or moment,
            view.evidence,
        )
        for view, length in zip(views, clip_ms, strict=True)
    ]
    arrival = Arrival(run.id, run.public_id, run.origin, run.view_tickets, moment, arriving)
    return take_views(intake, connection, arrival)


def _new_view_row(
    run: RunOfViews, view: ViewIn, moment: datetime, issued_at: datetime | None
) -> dict[str, Any]:
    return {
        "view_id": str(view.id),
        "study_run_id": run.id,
        "trial_index": view.trial_index,
        "number": view.number,
        "play": view.play or view.number,
        # The receipt of the view where the clock cannot be right; IMPOSSIBLE says so.
        "started_at_client": view.started_at_client or moment,
        "received_at": moment,
        "completed": False,
        "screen": view.screen,
        "disturbances": {} if view.started_at_client else {IMPOSSIBLE: 1},
        "issued_at": issued_at,
    }


def _complete(connection: Connection, run: RunOfViews, view: ViewIn, length: float) -> None:
    ended = {
        "ended_at_client": view.ended_at_client,
        "outcome": view.outcome,
        "disturbances": view.disturbances,
        "showings": None if view.showings is None else [one.model_dump() for one in view.showings],
        "clip_ms": length or None,
    }
    view_repository.complete(connection, run.id, str(view.id), ended)
    for role, clip in {clip.role: clip for clip in view.clips}.items():
        view_repository.add_clip(
            connection, run.id, str(view.id), role, clip.clip_sha256, pack_log(clip.drawn)
        )


def unanswered_views(session: Session, run: StudyRun) -> dict[int, list[ViewState]]:
    """The views of each trial that were begun for a play without an answer yet, in their order."""
    waiting = view_repository.unanswered_views(session, run)
    clips = view_repository.clips_of(session, waiting)
    by_trial: dict[int, list[ViewState]] = {}
    for view in waiting:
        by_trial.setdefault(view.trial_index, []).append(_state(view, clips.get(view.id, [])))
    return by_trial


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
                    {"role": clip.role, "clip_sha256": clip.clip_sha256, "drawn": unpack_log(clip.frame_log)}
                )
                for clip in clips
            ],
            "disturbances": view.disturbances,
        }
    )
