"""Downloads of a study's data; every one is streamed in constant memory."""

from collections.abc import Callable, Iterable, Iterator

from fastapi import APIRouter, Response
from fastapi.responses import StreamingResponse
from sqlalchemy.orm import Session

from server.accounts.audit import record
from server.accounts.identity import Exporter, Identity, Viewer
from server.clock import now
from server.context import Services, ServicesDep
from server.errors import ERROR_RESPONSES
from server.export import codebook, psych_ds, runs
from server.export.pieces import csv_pieces, rating_table
from server.models import Study
from server.studies.lookup import active_definition, active_version, find_study

router = APIRouter(prefix="/api/admin/studies/{study}/data", tags=["data"], responses=ERROR_RESPONSES)


def _stream(
    services: Services,
    who: Identity,
    name: str,
    kind: str,
    media_type: str,
    file: str,
    pieces: Callable[[Session, Study], Iterable[bytes]],
) -> StreamingResponse:
    with services.database.write() as session:
        find_study(session, name)  # an unknown study is refused before the stream begins
        record(session, who, "data downloaded", "study", name, what=kind)

    def body() -> Iterator[bytes]:
        with services.database.read() as session:
            yield from pieces(session, find_study(session, name))

    headers = {"content-disposition": f'attachment; filename="{file}"'}
    return StreamingResponse(body(), media_type=media_type, headers=headers)


@router.get("/ratings.csv", response_class=StreamingResponse)
def download_ratings(services: ServicesDep, who: Exporter, study: str) -> StreamingResponse:
    """One row a play: the columns of the codebook, one column a factor."""
    pieces = lambda session, found: csv_pieces(rating_table(session, found))  # noqa: E731
    return _stream(services, who, study, "ratings", "text/csv; charset=utf-8", f"{study}-ratings.csv", pieces)


@router.get("/runs.csv", response_class=StreamingResponse)
def download_runs(services: ServicesDep, who: Exporter, study: str) -> StreamingResponse:
    """One row a visit, forms included."""
    pieces = lambda session, found: csv_pieces(runs.run_rows(session, found))  # noqa: E731
    return _stream(services, who, study, "runs", "text/csv; charset=utf-8", f"{study}-runs.csv", pieces)


@router.get("/raw.ndjson", response_class=StreamingResponse)
def download_raw(services: ServicesDep, who: Exporter, study: str) -> StreamingResponse:
    """Everything stored, one JSON object a run and line."""

    def pieces(session: Session, found: Study) -> Iterator[bytes]:
        for line in runs.raw_lines(session, found):
            yield line.encode("utf-8")

    return _stream(services, who, study, "raw", "application/x-ndjson", f"{study}-raw.ndjson", pieces)


@router.get("/psych-ds.zip", response_class=StreamingResponse)
def download_psych_ds(services: ServicesDep, who: Exporter, study: str) -> StreamingResponse:
    """A Psych-DS dataset as a zip."""

    def pieces(session: Session, found: Study) -> Iterator[bytes]:
        version = active_version(session, found)
        made = now().date().isoformat()
        yield from psych_ds.dataset(session, found, version, active_definition(session, found), made)

    return _stream(services, who, study, "psych-ds", "application/zip", f"{study}-psych-ds.zip", pieces)


@router.get("/codebook.md", response_class=Response)
def download_codebook(services: ServicesDep, _who: Viewer, study: str) -> Response:
    """What every column means."""
    with services.database.read() as session:
        text = codebook.markdown(active_definition(session, find_study(session, study)))
    headers = {"content-disposition": f'attachment; filename="{study}-codebook.md"'}
    return Response(text, media_type="text/markdown; charset=utf-8", headers=headers)
