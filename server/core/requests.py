"""What nearly every endpoint needs of the running server: its database and its settings, as dependencies.

Those that need more take `server.context.ServicesDep`. This module knows nothing of the other parts, so that
what recognizes accounts rests on the database and the settings alone.
"""

from typing import Annotated

from fastapi import Depends, Request

from server.core.db import Database
from server.core.settings import Settings


# The dependencies are async so that FastAPI does not send them through its thread pool.
async def _settings(request: Request) -> Settings:
    settings: Settings = request.app.state.services.settings
    return settings


async def _database(request: Request) -> Database:
    database: Database = request.app.state.services.database
    return database


SettingsDep = Annotated[Settings, Depends(_settings)]
DatabaseDep = Annotated[Database, Depends(_database)]
