"""The application: `create_app(settings)` puts routers, headers and error shape together."""

import gc
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import lru_cache, partial

from fastapi import APIRouter, FastAPI, Request
from fastapi.routing import APIRoute
from starlette.routing import BaseRoute

from server import web
from server.accounts import endpoints as accounts
from server.accounts import provider_endpoints, workspace_endpoints
from server.accounts.audit import note_refusal
from server.context import open_services, services_of
from server.core.changes import ChangeNotifier
from server.core.error_handlers import install_error_handlers
from server.core.errors import ApiError
from server.core.settings import Settings
from server.exports import endpoints as exports
from server.operations import endpoints as operations
from server.operations.doctor import findings_for_studies
from server.operations.drill import weekly_drill
from server.operations.metrics import Observer, ProxyWatch
from server.operations.snapshots import snapshots_taken
from server.operations.watch import WatchedServer, studies_watched
from server.participation import endpoints as participation
from server.participation.judgement import digests_judged_later
from server.privacy import endpoints as privacy
from server.privacy.retention import hourly_retention
from server.rehearsals import endpoints as rehearsals
from server.request_limits import ConcurrencyLimit, RequestLimits
from server.results import endpoints as results
from server.results import own_tables
from server.results.kinds import results_counted_ahead
from server.studies import clip_endpoints, library
from server.studies import endpoints as studies
from server.web import RowSecurity, SecurityHeaders

API_VERSION = "1"
"""The version of the API, not of the program, whose version would help attackers."""


def _routers() -> tuple[APIRouter, ...]:
    """Every router: the busiest first, and `pages` last, which answers for whole folders of addresses."""
    return (
        participation.rating_router,
        participation.view_router,
        participation.router,
        clip_endpoints.clip_router,
        web.health_router,
        operations.router,
        operations.admin_router,
        accounts.router,
        accounts.credential_router,
        provider_endpoints.router,
        accounts.reset_router,
        accounts.people_router,
        workspace_endpoints.workspace_router,
        workspace_endpoints.grant_router,
        studies.router,
        results.build_router,
        clip_endpoints.upload_router,
        studies.life_router,
        studies.link_router,
        results.monitor_router,
        results.router,
        results.run_router,
        results.replay_router,
        privacy.person_router,
        privacy.retention_router,
        exports.seal_router,
        exports.router,
        exports.report_router,
        rehearsals.launch_router,
        rehearsals.router,
        exports.capsule_router,
        results.methods_router,
        own_tables.router,
        library.blink_router,
        library.strip_router,
        web.page_router,
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


async def _note_refusal(request: Request, refusal: ApiError) -> None:
    services = services_of(request)
    await note_refusal(
        request, refusal, services.database, known=services.refusals, strangers=services.strangers
    )


def create_app(settings: Settings | None = None, *, rehearses: bool = False) -> FastAPI:
    """The server with these settings (from the environment where None); the database must be migrated.

    Parameters
    ----------
    rehearses : bool, optional
        As in `open_services`.
    """
    services = open_services(settings or Settings(), rehearses=rehearses)

    examine = partial(findings_for_studies, services)
    watched = WatchedServer(services.settings, services.database, services.locks, examine)

    @asynccontextmanager
    async def lifespan(served: FastAPI) -> AsyncIterator[None]:
        served.state.services.stopping.listen()
        async with (
            weekly_drill(services.settings),
            snapshots_taken(services.settings),
            hourly_retention(services.database, services.settings, services.locks),
            digests_judged_later(services.database, services.intake),
            results_counted_ahead(services.database, services.results),
            studies_watched(watched),
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
    install_error_handlers(app, _note_refusal)
    app.add_middleware(ChangeNotifier, changes=services.changes)
    app.add_middleware(ConcurrencyLimit)  # inside the limits: a body that comes slowly holds no place
    app.add_middleware(RequestLimits, settings=services.settings)
    app.add_middleware(RowSecurity)  # outside the limits, which recognize accounts too
    app.add_middleware(SecurityHeaders, settings=services.settings, clips_from=services.clips.origin())
    app.add_middleware(Observer, settings=services.settings)
    app.add_middleware(ProxyWatch, settings=services.settings)
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
