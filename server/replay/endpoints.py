"""A run as it was shown: its trials, and each with its frame logs. Both are looks at one person's data."""

from typing import Annotated

from fastapi import APIRouter, Path

from server.accounts.audit import record
from server.accounts.permission import PersonalReader
from server.context import ServicesDep
from server.errors import ERROR_RESPONSES
from server.replay import service
from server.replay.schemas import Replay, ReplayedTrial
from server.studies.lookup import find_study

router = APIRouter(
    prefix="/api/admin/studies/{study}/runs/{run}/replay", tags=["participants"], responses=ERROR_RESPONSES
)


@router.get("")
def get_replay(services: ServicesDep, identity: PersonalReader, study: str, run: str) -> Replay:
    """The trials of a run that can be played back, and how they were to look."""
    with services.database.write() as session:
        replay = service.replay(session, find_study(session, study, identity, "export"), run)
        record(session, identity, "personal data read", "run", run, study=study, part="replay")
        return replay


@router.get("/trials/{trial_index}")
def get_replayed_trial(
    services: ServicesDep,
    identity: PersonalReader,
    study: str,
    run: str,
    trial_index: Annotated[int, Path(ge=0, le=1_000_000)],
) -> ReplayedTrial:
    """One trial: each view's frames and when they were drawn, its answers and events."""
    with services.database.write() as session:
        known = find_study(session, study, identity, "export")
        trial = service.replayed_trial(session, known, run, trial_index)
        record(session, identity, "personal data read", "run", run, study=study, part=f"trial {trial_index}")
        return trial
