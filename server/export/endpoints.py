"""Downloads of a study's data, of one origin unless all are asked for; streamed in constant memory."""

import shutil
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Response
from fastapi.responses import FileResponse, StreamingResponse
from starlette.background import BackgroundTask

from server.accounts.audit import record
from server.accounts.identity import Exporter, Identity, Myself, Viewer
from server.context import Services, ServicesDep
from server.errors import ERROR_RESPONSES, Conflict
from server.export.converted import convert, write_table
from server.export.formats import FORMATS, Format, proofed, row_count
from server.export.origins import ExportOrigin
from server.export.scripts import ScriptLanguage, script
from server.export.tables import answers_table, wide_table
from server.models import Right
from server.studies.lookup import active_definition, find_study
from server.text import encoded

router = APIRouter(prefix="/api/admin/studies/{study}/data", tags=["data"], responses=ERROR_RESPONSES)
CSV_TYPE = "text/csv; charset=utf-8"
_converting = threading.Lock()
"""One conversion at a time: each is a process of its own that holds a whole table."""
ROWS_HEADER = "palpebra-rows"
"""How many rows (CSV: below the header; zip: of ratings; JSON lines: runs) a whole download holds."""


def _stream(
    services: Services,
    who: Identity,
    name: str,
    form: Format,
    origin: ExportOrigin,
    media_type: str,
    file: str,
    excel: bool = False,
) -> StreamingResponse:
    action = "identities downloaded" if form == "identities" else "data downloaded"
    right: Right = "own" if form == "identities" else "export"
    with services.database.write() as session:
        # An unknown study, and one without the right, is refused before the stream begins.
        find_study(session, name, who, right)
        record(session, who, action, "study", name, what=form, origin=origin)

    pieces = _pieces(services, who, name, form, origin, excel)
    whose = "" if origin == "participant" or form == "identities" else f"{origin}-"
    # The first piece is the number of rows; taking it begins the snapshot that the rest is read from.
    headers = {
        "content-disposition": f'attachment; filename="{name}-{whose}{file}"',
        ROWS_HEADER: next(pieces).decode(),
    }
    return StreamingResponse(pieces, media_type=media_type, headers=headers)


def _pieces(
    services: Services, who: Identity, name: str, form: Format, origin: ExportOrigin, excel: bool
) -> Iterator[bytes]:
    """The number of rows, then the export; what goes wrong ends the connection before the answer's end."""
    with services.database.snapshot() as session:
        study = find_study(session, name, who, "view")
        yield str(row_count(form, session, study, origin)).encode()
        yield from proofed(FORMATS[form](session, study, origin), form, bom=excel, guard=excel)


Excel = Annotated[
    bool, Query(description="Begin with a byte order mark, and make cells text that a spreadsheet would run.")
]


@router.get("/ratings.csv", response_class=StreamingResponse)
def download_ratings(
    services: ServicesDep,
    who: Exporter,
    study: str,
    origin: ExportOrigin = "participant",
    excel: Excel = False,
) -> StreamingResponse:
    """One row a play: the columns of the codebook, one column a factor."""
    return _stream(services, who, study, "csv", origin, CSV_TYPE, "ratings.csv", excel)


@router.get("/wide.csv", response_class=StreamingResponse)
def download_wide(
    services: ServicesDep,
    who: Exporter,
    study: str,
    origin: ExportOrigin = "participant",
    excel: Excel = False,
) -> StreamingResponse:
    """One row a visit: a column a question of the forms, and a column a cell with the mean rating in it."""
    return _stream(services, who, study, "wide", origin, CSV_TYPE, "wide.csv", excel)


@router.get("/runs.csv", response_class=StreamingResponse)
def download_runs(
    services: ServicesDep,
    who: Exporter,
    study: str,
    origin: ExportOrigin = "participant",
    excel: Excel = False,
) -> StreamingResponse:
    """One row a visit, a column a question of the forms."""
    return _stream(services, who, study, "runs", origin, CSV_TYPE, "runs.csv", excel)


@router.get("/analysis.{language}", response_class=Response)
def download_script(services: ServicesDep, who: Viewer, study: str, language: ScriptLanguage) -> Response:
    """A script that analyses the long CSV, saved beside it under its own name: for R, or for Python."""
    with services.database.read() as session:
        text = script(
            active_definition(session, find_study(session, study, who, "view")),
            language,
            f"{study}-ratings.csv",
        )
    headers = {"content-disposition": f'attachment; filename="{study}.{language}"'}
    return Response(encoded(text), media_type="text/plain; charset=utf-8", headers=headers)


@router.get("/raw.ndjson", response_class=StreamingResponse)
def download_raw(
    services: ServicesDep, who: Exporter, study: str, origin: ExportOrigin = "participant"
) -> StreamingResponse:
    """Everything stored, one JSON object a run and line."""
    return _stream(services, who, study, "raw", origin, "application/x-ndjson", "raw.ndjson")


@router.get("/psych-ds.zip", response_class=StreamingResponse)
def download_psych_ds(
    services: ServicesDep, who: Exporter, study: str, origin: ExportOrigin = "participant"
) -> StreamingResponse:
    """A Psych-DS dataset as a zip."""
    return _stream(services, who, study, "psych-ds", origin, "application/zip", "psych-ds.zip")


@router.get("/identities.csv", response_class=StreamingResponse)
def download_identities(services: ServicesDep, who: Myself, study: str) -> StreamingResponse:
    """Recruiters' ids beside the pseudonyms, one row a visit; for owners of the study, and audited."""
    return _stream(services, who, study, "identities", "all", CSV_TYPE, "identities.csv")


@router.get("/codebook.md", response_class=Response)
def download_codebook(services: ServicesDep, who: Viewer, study: str) -> Response:
    """What every column means."""
    with services.database.read() as session:
        text = b"".join(FORMATS["codebook"](session, find_study(session, study, who, "view"), "all"))
    headers = {"content-disposition": f'attachment; filename="{study}-codebook.md"'}
    return Response(text, media_type="text/markdown; charset=utf-8", headers=headers)


def _write_whole(
    services: Services, who: Identity, name: str, form: Format, origin: ExportOrigin, folder: Path
) -> int:
    """Write the table of `form` from one snapshot, which ends before the conversion; return its rows."""
    with services.database.write() as session:
        known = find_study(session, name, who, "export")
        record(session, who, "data downloaded", "study", known.name, what=form, origin=origin)
    with services.database.snapshot() as session:
        study = find_study(session, name, who, "view")
        rows = row_count(form, session, study, origin)
        table_of = wide_table if form.endswith("-wide") else answers_table
        write_table(table_of(session, study, origin), folder)
    return rows


@router.get("/{table}.{ending}", response_class=FileResponse)
def download_converted(
    services: ServicesDep,
    who: Exporter,
    study: str,
    table: Literal["ratings", "wide"],
    ending: Literal["sav", "parquet"],
    origin: ExportOrigin = "participant",
) -> FileResponse:
    """One row a play, or the wide table, for SPSS or as Parquet: with labels of variables and levels."""
    # The last route of this file: its path would stand in for those of the other downloads.
    long: dict[str, Format] = {"sav": "spss", "parquet": "parquet"}
    wide: dict[str, Format] = {"sav": "spss-wide", "parquet": "parquet-wide"}
    form = (long if table == "ratings" else wide)[ending]
    if not _converting.acquire(blocking=False):
        raise Conflict("Another file for SPSS or as Parquet is being made; try again in a moment.")
    folder = Path(tempfile.mkdtemp(prefix="export-"))
    try:
        rows = _write_whole(services, who, study, form, origin, folder)
        file = convert(folder, ending)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    finally:
        _converting.release()
    whose = "" if origin == "participant" else f"{origin}-"
    return FileResponse(
        file,
        media_type="application/octet-stream",
        filename=f"{study}-{whose}{table}.{ending}",
        headers={ROWS_HEADER: str(rows)},
        background=BackgroundTask(shutil.rmtree, folder, ignore_errors=True),
    )
