"""Why a participant's request or answer is refused."""

from server.core.errors import ApiError, Conflict, Invalid, NotFound

# Why an answer is refused: the visit is not known, over, or has not begun.


class RunUnknown(ApiError):
    """No run has this token."""

    status = 401
    code = "run_unknown"


class RunClosed(Conflict):
    """The run is over."""

    code = "run_closed"


class TrialNotInRun(NotFound):
    """The run has no such trial."""

    code = "trial_not_in_run"


class ConsentMissing(Conflict):
    """Nothing is stored before the participant has agreed."""

    code = "consent_missing"


# Why an answer is refused for what comes, or does not come, with it.


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


class UnratedWithoutDigest(DigestMissing):
    """As before, of a play without a rating: a page that was loaded again may not have its clip yet."""


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


# Why a participant's request is refused.


class LinkUnknown(NotFound):
    """No link has this token, or it was withdrawn."""

    code = "link_unknown"


class LinkExpired(Conflict):
    """The link's time is over."""

    code = "link_expired"


class StudyClosed(Conflict):
    """The study takes no more participants."""

    code = "study_closed"


class StudyPaused(Conflict):
    """The study takes no participants for the moment."""

    code = "study_paused"


class StudyFull(Conflict):
    """Every place is taken."""

    code = "study_full"


class GroupRefused(Invalid):
    """The address asks for a group that its link is not for."""

    code = "group_refused"


class GroupDecided(Conflict):
    """An answer that decided the group is not changed afterwards."""

    code = "group_decided"


class RunTooOld(Conflict):
    """The visit began too long ago to be taken up again."""

    code = "run_too_old"


class RunLeft(Conflict):
    """The study must be done in one go, and the visit was left."""

    code = "run_left"


class ResumeCodeNeeded(Conflict):
    """A visit under this recruiter's id has begun in another browser; the id alone does not take it up."""

    code = "resume_code_needed"


class ResumeCodeWrong(Conflict):
    """The resume code is that of no visit by this link."""

    code = "resume_code_wrong"


class IdentifierInvalid(Invalid):
    """The recruiter's id in the address is not written as that recruiter writes its ids."""

    code = "identifier_invalid"


class RecruiterNotSet(Conflict):
    """The address is of a recruiter that neither the link nor the study has."""

    code = "recruiter_not_set"


class SignatureMissing(Conflict):
    """Addresses of this study are signed, and this one is not."""

    code = "signature_missing"


class SignatureWrong(Conflict):
    """The signature of the address is not that of its participant and study."""

    code = "signature_wrong"


class TakenPartAlready(Conflict):
    """A visit under this recruiter's id is over."""

    code = "taken_part_already"


class RatingsMissing(Conflict):
    """Trials are still to be answered."""

    code = "ratings_missing"


class FormsMissing(Conflict):
    """Forms with required questions are still to be answered."""

    code = "forms_missing"


class ScreeningUndeclared(Conflict):
    """The study does not screen by this."""

    code = "screening_undeclared"


class LanguageUnknown(Invalid):
    """The study has no texts in this language."""

    code = "language_unknown"


class FormUnknown(NotFound):
    """The study declares no such form."""

    code = "form_unknown"


class FormInvalid(Invalid):
    """An answer does not fit its question."""

    code = "form_invalid"
