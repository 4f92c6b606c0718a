"""The Methods paragraph of a study, for the admin site."""

from typing import Literal

from fastapi import APIRouter, Response
from pydantic import BaseModel, Field

from server.accounts.permission import Viewer
from server.context import ServicesDep
from server.errors import ERROR_RESPONSES
from server.methods import service
from server.numbers import Number
from server.studies.lookup import find_study

router = APIRouter(prefix="/api/admin/studies/{study}/methods", tags=["reports"], responses=ERROR_RESPONSES)
MethodsOrigin = Literal["participant", "pilot", "simulated"]


class MethodsNumber(BaseModel):
    """A number of the paragraph and where it comes from."""

    name: str
    value: int
    source: str = Field(description="The query of the database that gives it.")


class MethodsOut(BaseModel):
    """The paragraph and its numbers."""

    origin: MethodsOrigin
    series: int
    paragraph: str
    latex: str
    numbers: list[MethodsNumber]


@router.get("")
def get_methods(
    services: ServicesDep,
    identity: Viewer,
    study: str,
    origin: MethodsOrigin = "participant",
    series: Number | None = None,
) -> MethodsOut:
    """Recruitment, screening, checks, exclusions, display and automated answers, in sentences with counts."""
    with services.database.read() as session:
        methods = service.methods_of(session, find_study(session, study, identity, "view"), origin, series)
    listed = [MethodsNumber.model_validate(vars(number)) for number in methods.numbers.values()]
    return MethodsOut(
        origin=origin, series=methods.series, paragraph=methods.plain(), latex=methods.latex(), numbers=listed
    )


@router.get("/methods.txt", response_class=Response)
def get_methods_text(
    services: ServicesDep,
    identity: Viewer,
    study: str,
    origin: MethodsOrigin = "participant",
    series: Number | None = None,
) -> Response:
    """The paragraph as plain text, with the query of each number below it."""
    with services.database.read() as session:
        methods = service.methods_of(session, find_study(session, study, identity, "view"), origin, series)
    return Response(methods.text(), media_type="text/plain; charset=utf-8")
