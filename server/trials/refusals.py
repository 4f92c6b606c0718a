"""Why an answer is refused: the visit is not known, over, or has not begun."""

from server.errors import ApiError, Conflict


class RunUnknown(ApiError):
    """No run has this token."""

    status = 401
    code = "run_unknown"


class RunClosed(Conflict):
    """The run is over."""

    code = "run_closed"


class ConsentMissing(Conflict):
    """Nothing is stored before the participant has agreed."""

    code = "consent_missing"
