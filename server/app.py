"""The application: `create_app(settings)` puts routers, headers and error shape together."""

import gc
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import lru_cache

from fastapi import APIRouter, FastAPI
from fastapi.routing import APIRoute
from starlette.routing import BaseRoute

from server import health, pages
from server.accounts import credential_endpoints as credentials
from server.accounts import endpoints as accounts
from server.accounts import people
from server.accounts.refusals import note_refusal
from server.capsules import endpoints as capsules
from server.changes import ChangesTold
from server.clips import endpoints as clips
from server.context import open_services
from server.door import Door
from server.errors import install_error_handlers
from server.evidence.later import digests_judged_later
from server.export import endpoints as export
from server.lane import ExperimentersLane
from server.library import endpoints as library
from server.library import strips
from server.methods import endpoints as methods
from server.middleware import RowSecurity, SecurityHeaders
from server.monitor import endpoints as monitor
from server.operations import endpoints as operations
from server.operations.drill_schedule import weekly_drill
from server.operations.observer import Observer
from server.operations.snapshot_schedule import snapshots_taken
from server.participants import endpoints as participants
from server.participants import rating_endpoints as trials
from server.participants import view_endpoints as views
from server.persons import endpoints as persons
from server.providers import endpoints as providers
from server.rehearsals import endpoints as rehearsals
from server.replay import endpoints as replay
from server.reports import endpoints as reports
from server.resets import endpoints as resets
from server.results import endpoints as results
from server.results.ahead import results_counted_ahead
from server.retention import endpoints as retention
from server.retention.schedule import hourly_retention
from server.runs import endpoints as runs
from server.seals import endpoints as seals
from server.settings import Settings
from server.studies import endpoints as studies
from server.studies import life_endpoints as life_cycle
from server.studies import link_endpoints as links
from server.studies import upload_endpoints as uploads
from server.workspaces import endpoints as workspaces
from server.workspaces import grant_endpoints as grants

API_VERSION = "1"
"""Of the API, not of the program: which weaknesses that may have is nobody's business who asks."""


def _routers() -> tuple[APIRouter, ...]:
    """Every router: the busiest first, and `pages` last, which answers for whole folders of addresses."""
    return (
        trials.router,
        views.router,
        participants.router,
        clips.router,
        health.router,
        operations.router,
        operations.admin_router,
        accounts.router,
        credentials.router,
        providers.router,
        resets.router,
        people.router,
        workspaces.router,
        grants.router,
        studies.router,
        uploads.router,
        life_cycle.router,
        links.router,
        monitor.router,
        results.router,
        runs.router,
        replay.router,
        persons.router,
        retention.router,
        seals.router,
        export.router,
        reports.router,
        rehearsals.router,
        capsules.router,
        methods.router,
        library.router,
        strips.router,
        pages.router,
    )


def _operation_id(route: APIRoute) -> str:
    return route.name


@lru_cache(maxsize=1)
def every_route() -> tuple[BaseRoute, ...]:
    """What every application of this process answers to, ready for its first request.

    FastAPI leaves half a second of work to the first request that goes through them all, as one for a page
    does: somebody would wait for it after each start, and everybody else with them. Routes that several
    applications share know none of them: `dependency_overrides` and lifespans of routers are not for them.
    """
    whole = APIRouter(generate_unique_id_function=_operation_id)
    for router in _routers():
        whole.include_router(router)
    # matching builds what FastAPI leaves to the first request
    for route in whole.routes:
        route.matches({"type": "http", "method": "GET", "path": "/", "root_path": "", "headers": []})
    return tuple(whole.routes)


def create_app(settings: Settings | None = None, *, rehearses: bool = False) -> FastAPI:
    """The server with these settings (from the environment where None); the database must be migrated.

    Parameters
    ----------
    rehearses : bool, optional
        As in `open_services`.
    """
    services = open_services(settings or Settings(), rehearses=rehearses)

    @asynccontextmanager
    async def lifespan(served: FastAPI) -> AsyncIterator[None]:
        served.state.services.stopping.listen()
        async with (
            weekly_drill(services.settings),
            snapshots_taken(services.settings),
            hourly_retention(services.database, services.settings, services.locks),
            digests_judged_later(services.database, services.intake),
            results_counted_ahead(services.database, services.results),
        ):
            yield
        served.state.services.changes.close()
        served.state.services.preparing.close()
        served.state.services.passwords.close()
        served.state.services.intake.clips.close()
        served.state.services.group_commit.close()
        served.state.services.database.close()

    app = FastAPI(
        title="Palpebra",
        version=API_VERSION,
        summary="Factorial rating studies of short clips: participants, ratings, data.",
        openapi_url="/api/openapi.json",
        docs_url=None,
        redoc_url=None,
        generate_unique_id_function=_operation_id,
        lifespan=lifespan,
    )
    app.state.services = services
    app.router.routes.extend(every_route())
    install_error_handlers(app, note_refusal)
    app.add_middleware(ChangesTold, changes=services.changes)
    app.add_middleware(ExperimentersLane)  # inside the door: a body that comes slowly holds no place
    app.add_middleware(Door, settings=services.settings)
    app.add_middleware(RowSecurity)  # outside the door, which recognises accounts too
    app.add_middleware(SecurityHeaders, settings=services.settings, clips_from=services.clips.origin())
    app.add_middleware(Observer, settings=services.settings)
    return app


def create_lasting_app() -> FastAPI:
    """The server of a process that serves nothing else, with settings from the environment.

    What is there now stays to the end. The collector of garbage goes through it no more: each of its full
    rounds held up every rater for a tenth of a second.
    """
    app = create_app()
    gc.collect()
    gc.freeze()
    return app
