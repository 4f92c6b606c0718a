"""All tables, one module a subject; import them from here."""

from server.models.accounts import (
    ROLES,
    Account,
    AdminSession,
    ApiToken,
    AuditEntry,
    Invitation,
    Job,
    Role,
)
from server.models.base import Base, UtcDateTime
from server.models.evidence import AnswerEvidence
from server.models.limits import SharedCount
from server.models.logins import AccountLogin, LoginAttempt, Purpose
from server.models.mail import LetterPurpose, MailedLink
from server.models.runs import NO_SLOT, RUN_STATUSES, STAGES, IdentityKey, RecruiterIdentity, StudyRun
from server.models.series import SeriesAnswer, SeriesOffer, SeriesTrial
from server.models.studies import Clip, Link, Study, StudyVersion, VersionClip
from server.models.tallies import RunTally
from server.models.trials import AssignedTrial, Rating, TrialClip
from server.models.views import View, ViewClip
from server.models.visit import Calibration, FormAnswer, RunEvent
from server.models.workspaces import (
    DEFAULT_WORKSPACE,
    RIGHTS,
    Right,
    StudyGrant,
    Workspace,
    WorkspaceMember,
)

__all__ = [
    "DEFAULT_WORKSPACE",
    "NO_SLOT",
    "RIGHTS",
    "ROLES",
    "RUN_STATUSES",
    "STAGES",
    "Account",
    "AccountLogin",
    "AdminSession",
    "AnswerEvidence",
    "ApiToken",
    "AssignedTrial",
    "AuditEntry",
    "Base",
    "Calibration",
    "Clip",
    "FormAnswer",
    "IdentityKey",
    "Invitation",
    "Job",
    "LetterPurpose",
    "Link",
    "LoginAttempt",
    "MailedLink",
    "Purpose",
    "Rating",
    "RecruiterIdentity",
    "Right",
    "Role",
    "RunEvent",
    "RunTally",
    "SeriesAnswer",
    "SeriesOffer",
    "SeriesTrial",
    "SharedCount",
    "Study",
    "StudyGrant",
    "StudyRun",
    "StudyVersion",
    "TrialClip",
    "UtcDateTime",
    "VersionClip",
    "View",
    "ViewClip",
    "Workspace",
    "WorkspaceMember",
]
