"""The snapshots that the server takes by itself of a SQLite database."""

import asyncio
import logging
from contextlib import AbstractAsyncContextManager, nullcontext

from experiments.errors import InputError
from server.clock import now
from server.db import checked_url
from server.operations.snapshots import (
    SnapshotUnderWayError,
    erase_in_snapshots,
    is_due,
    remove_superfluous,
    take_snapshot,
)
from server.settings import Settings
from server.watching import watched

LOG = logging.getLogger(__name__)
LOOK_EVERY_S = 20.0


def snapshots_taken(
    settings: Settings, look_every_s: float = LOOK_EVERY_S
) -> AbstractAsyncContextManager[None]:
    """Take snapshots while the server runs; nothing where the settings ask for none, or on PostgreSQL."""
    url = checked_url(settings.resolved_database_url)
    if not settings.snapshot_minutes or url.get_backend_name() != "sqlite":
        return nullcontext()
    return watched(lambda _: _watch(settings, look_every_s))


async def _watch(settings: Settings, look_every_s: float) -> None:
    while True:
        await asyncio.sleep(look_every_s)
        try:
            await asyncio.to_thread(look, settings)
        except InputError as error:  # such as no room: in words, and the next look comes
            LOG.error("snapshot: %s", error)
        except Exception:  # the next look comes, whatever went wrong with this one
            LOG.exception("snapshot")


def look(settings: Settings) -> None:
    """Take a snapshot if one is due, remove what is too many, and erase in the others who was erased."""
    if is_due(settings, now()):
        try:
            snapshot = take_snapshot(settings)
        except SnapshotUnderWayError:  # another worker is at it
            return
        LOG.info("snapshot %s", snapshot.path.name)
        remove_superfluous(settings, now())
    erase_in_snapshots(settings)
