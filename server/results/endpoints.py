"""The results page's data."""

from typing import Annotated

from fastapi import APIRouter, Header, Response
from pydantic import Field

from server.accounts.permission import Viewer
from server.context import ServicesDep
from server.errors import ERROR_RESPONSES
from server.numbers import Number
from server.participants.schemas import Origin
from server.results import counting
from server.results.cache import Revision
from server.results.schemas import AnyResults
from server.studies.lookup import find_study

router = APIRouter(prefix="/api/admin/studies/{study}", tags=["results"], responses=ERROR_RESPONSES)


ByKind = Annotated[AnyResults, Field(discriminator="kind")]


@router.get(
    "/results",
    response_model=Annotated[AnyResults, Field(discriminator="kind")],
    responses={304: {"description": "Nothing has changed."}},
)
def get_results(
    services: ServicesDep,
    identity: Viewer,
    study: str,
    origin: Origin = "participant",
    series: Number | None = None,
    scale: str | None = None,
    if_none_match: Annotated[str | None, Header()] = None,
) -> Response:
    """What the answers so far look like, by kind of trial, with response times and playback.

    They are of one origin, one data series (that of the active version where none is given) and, where
    clips are rated, one scale (the first). With the ETag of an earlier answer as `If-None-Match` it is 304
    where nothing has changed. Where counting takes long `counted_at` may lie some time back.
    """

    def count() -> tuple[Revision, AnyResults]:
        with services.database.read() as session:
            return counting.counted(
                session, find_study(session, study, identity, "view"), origin, series, scale
            )

    with services.database.read() as session:
        known = find_study(session, study, identity, "view")
        pool, _, revision = counting.pool_and_revision(session, known, origin, series, scale)
    counted = services.results.get(pool, revision, count)
    headers = {"etag": counted.etag, "cache-control": "private, no-cache"}
    if if_none_match == counted.etag:
        return Response(status_code=304, headers=headers)
    return Response(counted.results.model_dump_json(), media_type="application/json", headers=headers)
