"""What the admin site shows of the backups."""

from pydantic import BaseModel, Field

from experiments.errors import InputError
from server.operations.watched_backups import (
    OLD_AFTER_S,
    DrillResult,
    WatchedBackups,
    last_drill,
    watched_backups,
)
from server.settings import Settings


class BackupsOut(BaseModel):
    """How the backups are."""

    watched: bool = Field(description="Whether the settings name where they are (PALPEBRA_BACKUP_FOLDER).")
    address: str
    problem: str = Field(description="Why their store could not be asked; empty where it could.")
    number: int
    newest: str | None
    age_hours: float | None = Field(description="Of the newest.")
    old: bool = Field(description="There is none, or none of the last two days.")
    drill: DrillResult | None
    drilled_elsewhere: bool = Field(
        description="They are encrypted, and this server has no private key to drill them."
    )


def backups_out(settings: Settings) -> BackupsOut:
    """Look at the backups."""
    problem, watched = "", None
    try:
        watched = watched_backups(settings)
    except InputError as error:
        problem = str(error)
    seen = watched or WatchedBackups(0, None, None, last_drill(settings))
    return BackupsOut(
        watched=watched is not None or problem != "",
        address=str(settings.backup_folder),
        problem=problem,
        number=seen.number,
        newest=seen.newest,
        age_hours=None if seen.age_s is None else seen.age_s / 3600,
        old=seen.age_s is None or seen.age_s > OLD_AFTER_S,
        drill=seen.drill,
        drilled_elsewhere=seen.drilled_elsewhere,
    )
