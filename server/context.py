"""What endpoints need of the running server, as FastAPI dependencies."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from fastapi import Depends, Request

from server.accounts.credentials import PasswordWork
from server.accounts.provider_protocol import Providers
from server.accounts.throttle import SignInThrottle
from server.core.changes import Changes, Stopping
from server.core.commit import GroupCommit
from server.core.db import REQUEST_BUSY_S, Database, open_database
from server.core.limits import BoundedRecords, OpenStreams, RateLimit, SharedCounts
from server.core.locks import Locks, open_locks
from server.core.settings import Settings
from server.core.storage import ClipStore, FolderStore, open_s3
from server.core.values import now
from server.participation.clip_hashes import ClipHashes
from server.participation.intake import Intake
from server.participation.versions import Versions
from server.results.cache import ResultsCache
from server.transcoding.preparing import StoredClips, UploadPreparation

SIMULATED_TIME = "x-palpebra-simulated-time"
REFUSALS_PER_MINUTE, REFUSALS_OF_A_KIND = 20, 3
"""Refusals that a process writes into the audit log a minute: in all, and for one account at one route; of
nobody's as many again, so that strangers use up no room of those who are known."""
RESUME_CODES_PER_MINUTE = 10
"""Resume codes that may be tried for one visit a minute."""


@dataclass(frozen=True)
class Services:
    """The parts of one running server: made once by `create_app`."""

    settings: Settings
    database: Database
    clips: ClipStore
    stored_clips: StoredClips
    run_starts: RateLimit
    unsupported: RateLimit
    versions: Versions
    group_commit: GroupCommit
    sign_ins: SignInThrottle
    refusals: BoundedRecords
    strangers: BoundedRecords
    passwords: PasswordWork
    stopping: Stopping
    results: ResultsCache
    intake: Intake
    resume_codes: RateLimit
    preparing: UploadPreparation
    providers: Providers
    streams: OpenStreams
    locks: Locks
    changes: Changes

    def time_of(self, request: Request) -> datetime:
        """When a participant's request came in: now, but where simulated people say when they act."""
        said = request.headers.get(SIMULATED_TIME) if self.intake.rehearses else None
        return datetime.fromisoformat(said) if said else now()


def open_services(settings: Settings, *, rehearses: bool = False) -> Services:
    """Open database and clip store; nothing is migrated or started.

    Parameters
    ----------
    rehearses : bool, optional
        Simulated runs are held to what people are held to, and say what time it is.
    """
    database = open_database(settings, REQUEST_BUSY_S)
    clips = open_s3(settings) if settings.s3_bucket else FolderStore(settings.clip_folder)
    shared = None if database.is_sqlite else SharedCounts(database, lambda: settings.key)
    locks = open_locks(settings, database)
    return Services(
        settings=settings,
        database=database,
        clips=clips,
        stored_clips=StoredClips(clips),
        run_starts=RateLimit(settings.run_starts_per_minute, name="run starts", shared=shared),
        unsupported=RateLimit(settings.unsupported_per_minute, name="unsupported", shared=shared),
        versions=Versions(),
        group_commit=GroupCommit(database),
        sign_ins=SignInThrottle(settings, shared),
        refusals=BoundedRecords(REFUSALS_PER_MINUTE, REFUSALS_OF_A_KIND),
        strangers=BoundedRecords(REFUSALS_PER_MINUTE, REFUSALS_OF_A_KIND),
        passwords=PasswordWork(),
        stopping=Stopping(),
        results=ResultsCache(),
        intake=Intake(settings, ClipHashes(clips), rehearses=rehearses),
        resume_codes=RateLimit(RESUME_CODES_PER_MINUTE, name="resume codes", shared=shared),
        preparing=UploadPreparation(settings.upload_folder, locks),
        providers=Providers(settings),
        streams=OpenStreams(),
        locks=locks,
        changes=Changes(database),
    )


def services_of(request: Request) -> Services:
    """The services of the application that a request is to."""
    services: Services = request.app.state.services
    return services


# Async, so that FastAPI does not send it through its thread pool.
async def _services(request: Request) -> Services:
    return services_of(request)


ServicesDep = Annotated[Services, Depends(_services)]
