"""Why an answer is refused for what comes, or does not come, with it."""

from server.errors import ApiError, Conflict, Invalid


class TicketMissing(Invalid):
    """The run's answers carry tickets, and this one has none."""

    code = "ticket_missing"


class TicketInvalid(Invalid):
    """The batch was not sealed by this server, or was changed."""

    code = "ticket_invalid"


class TicketOfAnotherRun(Invalid):
    """The batch was issued for another run."""

    code = "ticket_of_another_run"


class TicketOfAnotherTrial(Invalid):
    """The ticket belongs to another trial or play, or was changed."""

    code = "ticket_of_another_trial"


class TicketExpired(Conflict):
    """The ticket is older than any visit may be."""

    code = "ticket_expired"


class ClipsOutlastTickets(Conflict):
    """The clips answered last longer than the time since their tickets were issued."""

    code = "clips_outlast_tickets"


class DigestMissing(Invalid):
    """The answer does not show that its clip was fetched."""

    code = "clip_digest_missing"


class DigestDiffers(Invalid):
    """The digest is not that of the trial's clip under its ticket."""

    code = "clip_digest_differs"


EVIDENCE_REFUSALS: tuple[type[ApiError], ...] = (
    TicketMissing,
    TicketInvalid,
    TicketOfAnotherRun,
    TicketOfAnotherTrial,
    TicketExpired,
    ClipsOutlastTickets,
    DigestMissing,
    DigestDiffers,
)
"""Refusals of an answer that may not have been given by a person: it is never counted as given."""
