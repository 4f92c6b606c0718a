"""The sealed plan of a study on the dashboard: seal it, look at it, take it away."""

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Response
from pydantic import BaseModel, ConfigDict, Field

from experiments.seal import Seal
from server.accounts.identity import Identity
from server.accounts.permission import Viewer, Writer
from server.context import Services, ServicesDep
from server.errors import ERROR_RESPONSES, NotFound
from server.seals.page import page
from server.seals.service import people_begun, seal_of, seal_plan
from server.studies.lookup import find_study
from server.text import encoded

router = APIRouter(prefix="/api/admin/studies/{study}/seal", tags=["data"], responses=ERROR_RESPONSES)


class NewSeal(BaseModel):
    """What is sealed with the plan."""

    model_config = ConfigDict(extra="forbid")
    power: Annotated[dict[str, Any], Field(max_length=1000)] | None = Field(
        default=None, description="What `analysis power --json` wrote."
    )


class SealOut(BaseModel):
    """Whether the plan of the active version's data series is sealed, and since when."""

    sealed_at: str | None
    sha256: str | None
    version: int | None
    power: bool = Field(description="Whether power was sealed with it.")
    participants: int = Field(description="Who has begun in this series: after the first nothing is sealed.")


@router.get("")
def get_seal(services: ServicesDep, identity: Viewer, study: str) -> SealOut:
    """Whether there is a sealed plan."""
    with services.database.read() as session:
        known = find_study(session, study, identity, "view")
        return _out(seal_of(session, known), people_begun(session, known))


def _out(seal: Seal | None, people: int) -> SealOut:
    if seal is None:
        return SealOut(sealed_at=None, sha256=None, version=None, power=False, participants=people)
    return SealOut(
        sealed_at=seal.sealed_at,
        sha256=seal.sha256,
        version=seal.version,
        power=seal.power is not None,
        participants=people,
    )


@router.post("", status_code=201)
def seal_study(services: ServicesDep, identity: Writer, study: str, body: NewSeal) -> SealOut:
    """Seal design, exclusions, analysis plan and power, once, before the first participant."""
    with services.database.write() as session:
        # Nobody has begun: else it would not be sealed.
        return _out(
            seal_plan(session, find_study(session, study, identity, "edit"), identity, body.power), people=0
        )


@router.get("/plan.{ending}", response_class=Response)
def download_seal(
    services: ServicesDep, identity: Viewer, study: str, ending: Literal["json", "html"]
) -> Response:
    """The sealed file, or a page of it that prints well."""
    seal = _sealed(services, study, identity)
    text, kind = (seal.text(), "application/json") if ending == "json" else (page(seal), "text/html")
    headers = {"content-disposition": f'attachment; filename="{study}-seal.{ending}"'}
    return Response(encoded(text), media_type=f"{kind}; charset=utf-8", headers=headers)


def _sealed(services: Services, study: str, identity: Identity) -> Seal:
    with services.database.read() as session:
        seal = seal_of(session, find_study(session, study, identity, "view"))
    if seal is None:
        raise NotFound(f"The plan of '{study}' is not sealed.")
    return seal
