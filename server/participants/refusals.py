"""Why a participant's request is refused."""

from server.errors import Conflict, Invalid, NotFound


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
