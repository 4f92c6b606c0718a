"""Why a participant's request or answer is refused."""

from server.core.errors import ApiError, Conflict, Invalid, NotFound

# Why an answer is refused: the visit is not known, over, or has not begun.


class RunUnknown(ApiError, status=401, code="run_unknown"):
    """No run has this token."""


class RunClosed(Conflict, code="run_closed"):
    """The run is over."""


class TrialNotInRun(NotFound, code="trial_not_in_run"):
    """The run has no such trial."""


class ConsentMissing(Conflict, code="consent_missing"):
    """Nothing is stored before the participant has agreed."""


# Why an answer is refused for what comes, or does not come, with it.


class TicketMissing(Invalid, code="ticket_missing"):
    """The run's answers carry tickets, and this one has none."""


class TicketInvalid(Invalid, code="ticket_invalid"):
    """The batch was not sealed by this server, or was changed."""


class TicketOfAnotherRun(Invalid, code="ticket_of_another_run"):
    """The batch was issued for another run."""


class TicketOfAnotherTrial(Invalid, code="ticket_of_another_trial"):
    """The ticket belongs to another trial or play, or was changed."""


class TicketExpired(Conflict, code="ticket_expired"):
    """The ticket is older than any visit may be."""


class ClipsOutlastTickets(Conflict, code="clips_outlast_tickets"):
    """The clips answered last longer than the time since their tickets were issued."""


class DigestMissing(Invalid, code="clip_digest_missing"):
    """The answer does not show that its clip was fetched."""


class UnratedWithoutDigest(DigestMissing):
    """As before, of a play without a rating: a page that was loaded again may not have its clip yet."""


class DigestDiffers(Invalid, code="clip_digest_differs"):
    """The digest is not that of the trial's clip under its ticket."""


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


class LinkUnknown(NotFound, code="link_unknown"):
    """No link has this token, or it was withdrawn."""


class LinkExpired(Conflict, code="link_expired"):
    """The link's time is over."""


class StudyClosed(Conflict, code="study_closed"):
    """The study takes no more participants."""


class StudyPaused(Conflict, code="study_paused"):
    """The study takes no participants for the moment."""


class StudyFull(Conflict, code="study_full"):
    """Every place is taken."""


class GroupRefused(Invalid, code="group_refused"):
    """The address asks for a group that its link is not for."""


class GroupDecided(Conflict, code="group_decided"):
    """An answer that decided the group is not changed afterwards."""


class RunTooOld(Conflict, code="run_too_old"):
    """The visit began too long ago to be taken up again."""


class RunLeft(Conflict, code="run_left"):
    """The study must be done in one go, and the visit was left."""


class ResumeCodeNeeded(Conflict, code="resume_code_needed"):
    """A visit under this recruiter's ID has begun in another browser; the id alone does not take it up."""


class ResumeCodeWrong(Conflict, code="resume_code_wrong"):
    """The resume code is that of no visit by this link."""


class IdentifierInvalid(Invalid, code="identifier_invalid"):
    """The recruiter's ID in the address is not written as that recruiter writes its ids."""


class RecruiterNotSet(Conflict, code="recruiter_not_set"):
    """The address is of a recruiter that neither the link nor the study has."""


class SignatureMissing(Conflict, code="signature_missing"):
    """Addresses of this study are signed, and this one is not."""


class SignatureWrong(Conflict, code="signature_wrong"):
    """The signature of the address is not that of its participant and study."""


class TakenPartAlready(Conflict, code="taken_part_already"):
    """A visit under this recruiter's ID is over."""


class RatingsMissing(Conflict, code="ratings_missing"):
    """Trials are still to be answered."""


class FormsMissing(Conflict, code="forms_missing"):
    """Forms with required questions are still to be answered."""


class ScreeningUndeclared(Conflict, code="screening_undeclared"):
    """The study does not screen by this."""


class LanguageUnknown(Invalid, code="language_unknown"):
    """The study has no texts in this language."""


class FormUnknown(NotFound, code="form_unknown"):
    """The study declares no such form."""


class FormInvalid(Invalid, code="form_invalid"):
    """An answer does not fit its question."""
