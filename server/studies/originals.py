"""Originals of converted clips: kept with the study as they were sent."""

from urllib.parse import quote

from sqlalchemy.orm import Session

from experiments.manifest import Manifest
from experiments.source_video import SourceVideo
from server.accounts.identity import Identity
from server.errors import NotFound
from server.studies.lookup import find_study


def find_source(session: Session, study: str, sha256: str, identity: Identity) -> SourceVideo:
    """What is known of an original, by its hash; NotFound where no version of the study has it."""
    for version in reversed(find_study(session, study, identity, "view").versions):
        for clip in Manifest.model_validate(version.manifest).clips:
            if clip.source is not None and clip.source.sha256 == sha256:
                return clip.source
    raise NotFound(
        "No clip of this study was made from such a file; reload the page to get the current list."
    )


def disposition(name: str) -> str:
    """The header by which a browser saves a file under its own name, in any script."""
    return f"attachment; filename*=UTF-8''{quote(name, safe='')}"
