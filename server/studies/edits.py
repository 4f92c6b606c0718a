"""What every change of a study begins with: nobody else changed it meanwhile."""

from sqlalchemy.orm import Session

from server.accounts.identity import Identity
from server.errors import Conflict
from server.models import Right, Study
from server.studies.lookup import find_study, must_not_be_archived


class EditedMeanwhile(Conflict):
    """Somebody else changed the study since this edit began."""

    code = "edited_meanwhile"


def for_edit(
    session: Session, name: str, revision: int, identity: Identity, right: Right, *, archived: bool = False
) -> Study:
    """The study to change; Conflict where somebody changed it since, or where it is in the archive."""
    study = find_study(session, name, identity, right)
    if study.revision != revision:
        raise EditedMeanwhile(
            f"Somebody else changed this study meanwhile (revision {study.revision}, yours was {revision}); "
            "load it again and repeat your edit.",
            revision=study.revision,
        )
    if not archived:
        must_not_be_archived(study)
    return study
