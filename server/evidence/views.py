"""What a view must bring along to be stored: the ticket of its play, and time enough."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime

from sqlalchemy import Connection

from server.errors import ApiError
from server.evidence import repository
from server.evidence.intake import Intake, milliseconds, too_short
from server.evidence.refusals import ClipsOutlastTickets, TicketMissing
from server.evidence.schemas import ViewEvidence
from server.evidence.tickets import check_ticket


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


def take_views(intake: Intake, connection: Connection, arrival: Arrival) -> list[datetime | None]:
    """When the ticket of each view was issued; refused by name where one cannot have begun or ended so.

    None without a ticket, as pages send views that were open before they had any, and where nothing is
    refused and the ticket does not hold.
    """
    issued: list[datetime | None] = []
    before = _Before(connection, arrival.run)
    for view in arrival.views:
        try:
            issued.append(_issued_at(intake, arrival, view, before))
        except ApiError as refusal:
            if intake.enforces(arrival.origin):
                intake.note(connection, arrival, refusal, repository.VIEW)
                raise
            issued.append(None)
    return issued


@dataclass
class _Before:
    """The run's views before one of an arrival: those stored, and `shown`, which came with it.

    Attributes
    ----------
    shown : list of (datetime, float)
        Issue and length of each.
    """

    connection: Connection
    run: int
    shown: list[tuple[datetime, float]] = field(default_factory=list)
    _spent: dict[datetime, repository.Spent] = field(default_factory=dict)

    def spent(self, since: datetime) -> repository.Spent:
        """What those stored took: read once a time, since none is stored while an arrival is looked at."""
        if since not in self._spent:
            self._spent[since] = repository.spent_by_views(self.connection, self.run, since)
        return self._spent[since]


def _issued_at(intake: Intake, arrival: Arrival, view: ArrivingView, before: _Before) -> datetime | None:
    """When the ticket of a view was issued; the view is added to those `before` the next."""
    given = view.evidence
    if given is None:
        if arrival.needs_tickets:
            raise TicketMissing("Expected a ticket with the view, got none; please load the page again.")
        return None
    where = (arrival.run_id, view.trial_index, view.play, min(arrival.received_at, view.given_at))
    issued_at = check_ticket(intake.key, given.batch, given.ticket, *where).issued_at
    if view.clip_ms > 0:
        before.shown.append((issued_at, view.clip_ms))
        _in_time(arrival.received_at, issued_at, before)
    return issued_at


def _in_time(received_at: datetime, issued_at: datetime, before: _Before) -> None:
    """ClipsOutlastTickets where the views of a batch, or of the run, cannot have been shown by now."""
    spent, shown = before.spent(issued_at), before.shown
    first = min(filter(None, (spent.first_issued_at, *(moment for moment, _ in shown))))
    of_batch = spent.batch_ms + sum(ms for moment, ms in shown if moment >= issued_at)
    of_run = spent.run_ms + sum(ms for _, ms in shown)
    for since, needed in ((issued_at, of_batch), (first, of_run)):
        there_was = milliseconds(received_at - since)
        if too_short(needed, there_was):
            raise ClipsOutlastTickets(
                f"Clips of {needed / 1000:.1f} s cannot have been shown in the {there_was / 1000:.1f} s "
                "since their tickets were issued; nothing is stored.",
                needed_ms=needed,
                there_was_ms=there_was,
            )
