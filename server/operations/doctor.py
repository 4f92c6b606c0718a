"""`server doctor`: run every check and say what to fix."""

from sqlalchemy.exc import SQLAlchemyError

from server.context import Services
from server.operations.checks import CHECKS
from server.operations.findings import Finding


def examine(services: Services) -> list[Finding]:
    """All findings; a check that cannot be made because of an earlier trouble says so."""
    findings: list[Finding] = []
    for check in CHECKS:
        try:
            findings.extend(check(services))
        except SQLAlchemyError as error:
            origin = getattr(error, "orig", None) or error
            said = str(origin).strip().splitlines()[0]
            advice = "see DATABASE_URL, then run: server database upgrade"
            findings.append(Finding(check.__name__.replace("_", " "), "failed", said, advice))
    return findings
