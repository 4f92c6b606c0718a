"""Downloads of a study's data, its capsules, reports and sealed plan."""

import shutil
import tempfile
import threading
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Depends, Query, Response
from fastapi.responses import FileResponse, StreamingResponse
from pydantic import BaseModel, ConfigDict, Field
from starlette.background import BackgroundTask

from experiments.seal import Seal
from server.accounts.access import Exporter, Myself, ReportReader, Viewer, Writer
from server.accounts.audit import record
from server.accounts.identity import Identity
from server.context import Services, ServicesDep
from server.core.db import Database
from server.core.errors import ERROR_RESPONSES, Conflict, NotFound
from server.core.requests import DatabaseDep, SettingsDep
from server.core.values import Number, encode_text
from server.exports import capsules as capsule_service
from server.exports import reports as report_service
from server.exports.formats import (
    CONVERSIONS,
    FORMATS,
    Conversion,
    Format,
    check_readable,
    convert,
    row_count,
    spreadsheet_pieces,
    write_table,
)
from server.exports.psych_ds import ScriptLanguage, script
from server.exports.schemas import (
    EVERYTHING,
    CapsuleOut,
    ExportOrigin,
    Extract,
    NewCapsule,
    NewReport,
    ReportOut,
)
from server.exports.seals import page, people_begun, seal_of, seal_plan
from server.models import Right
from server.participation.identity_keys import UnreadableError
from server.studies.lookup import active_version, definition_of, find_study
from server.studies.series import definition_of_series

# Downloads of a study's data, of one origin unless all are asked for; streamed in constant memory.

router = APIRouter(prefix="/api/admin/studies/{study}/data", tags=["data"], responses=ERROR_RESPONSES)
CSV_TYPE = "text/csv; charset=utf-8"
CONVERTED: dict[tuple[str, str], Format] = {
    ("ratings", "sav"): "spss",
    ("ratings", "parquet"): "parquet",
    ("wide", "sav"): "spss-wide",
    ("wide", "parquet"): "parquet-wide",
}
_converting = threading.Lock()
"""One conversion at a time: each is a separate process that holds a whole table."""
ROWS_HEADER = "palpebra-rows"
"""How many rows (CSV: below the header; zip: of ratings; JSON lines: runs) a whole download holds."""


Excel = Annotated[bool, Query(description="Begin with a byte order mark, so that Excel detects UTF-8.")]
Guard = Annotated[
    bool,
    Query(
        description="Put an apostrophe before each cell that a spreadsheet would run as a formula. "
        "With false, every text is exactly as given; use it only for programs."
    ),
]
Series = Annotated[
    Number | None, Query(description="Export one data series; by default all, distinguished by a column.")
]
OldOrder = Annotated[
    bool,
    Query(description="Use the column order of version 0.1; by default, columns are in logical order."),
]


@dataclass(frozen=True)
class Download:
    """A download that somebody asks for; `excel` and `guard` are of CSV alone."""

    services: Services
    identity: Identity
    study: str
    extract: Extract
    excel: bool = False
    guard: bool = True

    def note(self, form: Format) -> None:
        """Note it in the audit log; refused where there is no such study, or no right to this of it."""
        action = "identities downloaded" if form == "identities" else "data downloaded"
        right: Right = "own" if form == "identities" else "export"
        with self.services.database.write() as session:
            study = find_study(session, self.study, self.identity, right)
            definition_of_series(session, study, self.extract.series)
            series = {} if self.extract.series is None else {"series": self.extract.series}
            details = {"what": form, "origin": self.extract.origin} | series
            record(session, self.identity, action, "study", self.study, **details)

    def file_name(self, form: Format, file: str) -> str:
        """The file's name with the study's, the origin where it is not participants, and the series."""
        return f"{self.study}{'' if form == 'identities' else self.extract.file_part}-{file}"

    def stream(self, form: Format, media_type: str, file: str) -> StreamingResponse:
        """The export as it is read from the database."""
        self.note(form)
        if form == "identities":
            self._check_keys()
        pieces = self._pieces(form)
        # The first piece is the number of rows; taking it begins the snapshot that the rest is read from.
        headers = {
            "content-disposition": f'attachment; filename="{self.file_name(form, file)}"',
            ROWS_HEADER: next(pieces).decode(),
        }
        return StreamingResponse(pieces, media_type=media_type, headers=headers)

    def _check_keys(self) -> None:
        """Refuse in a line what would break off in the middle."""
        with self.services.database.read() as session:
            try:
                check_readable(session, find_study(session, self.study, self.identity, "own"))
            except UnreadableError as error:
                raise Conflict(f"{error}.") from error

    def _pieces(self, form: Format) -> Iterator[bytes]:
        """The number of rows, then the export; a fault ends the connection before the answer is whole."""
        with self.services.database.snapshot() as session:
            study = find_study(session, self.study, self.identity, "view")
            yield str(row_count(form, session, study, self.extract)).encode()
            export = FORMATS[form](session, study, self.extract)
            yield from spreadsheet_pieces(export, form, bom=self.excel, guard=self.guard)

    def write(self, conversion: Conversion, folder: Path) -> int:
        """Write a table from one snapshot, which ends before the conversion; return its rows."""
        with self.services.database.snapshot() as session:
            study = find_study(session, self.study, self.identity, "view")
            table = conversion.table(session, study, self.extract)
            write_table(table, folder)
        return table.count


async def _requested_download(
    services: ServicesDep,
    identity: Exporter,
    study: str,
    origin: ExportOrigin = "participant",
    series: Series = None,
    old_order: OldOrder = False,
) -> Download:
    return Download(services, identity, study, Extract(origin, series, old_order))


async def _asked_as_csv(
    download: Annotated[Download, Depends(_requested_download)], excel: Excel = False, guard: Guard = True
) -> Download:
    return replace(download, excel=excel, guard=guard)


Asked = Annotated[Download, Depends(_requested_download)]
AskedAsCsv = Annotated[Download, Depends(_asked_as_csv)]


@router.get("/ratings.csv", response_class=StreamingResponse)
def download_ratings(asked: AskedAsCsv) -> StreamingResponse:
    """One row per play: the columns of the codebook, one column per factor."""
    return asked.stream("csv", CSV_TYPE, "ratings.csv")


@router.get("/wide.csv", response_class=StreamingResponse)
def download_wide(asked: AskedAsCsv) -> StreamingResponse:
    """One row per visit: a column per form question, and a column per cell with its mean rating."""
    return asked.stream("wide", CSV_TYPE, "wide.csv")


@router.get("/runs.csv", response_class=StreamingResponse)
def download_runs(asked: AskedAsCsv) -> StreamingResponse:
    """One row per visit, one column per form question."""
    return asked.stream("runs", CSV_TYPE, "runs.csv")


@router.get("/analysis.{language}", response_class=Response)
def download_script(
    database: DatabaseDep, identity: Viewer, study: str, language: ScriptLanguage
) -> Response:
    """A script that analyses the long CSV, saved next to it under its own name: for R, or for Python."""
    with database.read() as session:
        version = active_version(session, find_study(session, study, identity, "view"))
        text = script(definition_of(version), language, f"{study}-ratings.csv", series=version.series)
    headers = {"content-disposition": f'attachment; filename="{study}.{language}"'}
    return Response(encode_text(text), media_type="text/plain; charset=utf-8", headers=headers)


@router.get("/raw.ndjson", response_class=StreamingResponse)
def download_raw(asked: Asked) -> StreamingResponse:
    """Plays, answers, drawn frames, events, forms and calibrations: one JSON object per run and line."""
    return asked.stream("raw", "application/x-ndjson", "raw.ndjson")


@router.get("/psych-ds.zip", response_class=StreamingResponse)
def download_psych_ds(asked: Asked) -> StreamingResponse:
    """A Psych-DS dataset as a zip."""
    return asked.stream("psych-ds", "application/zip", "psych-ds.zip")


@router.get("/identities.csv", response_class=StreamingResponse)
def download_identities(services: ServicesDep, identity: Myself, study: str) -> StreamingResponse:
    """Recruiters' IDs with the pseudonyms, one row per visit; for owners of the study, and audited."""
    return Download(services, identity, study, EVERYTHING).stream("identities", CSV_TYPE, "identities.csv")


@router.get("/codebook.md", response_class=Response)
def download_codebook(database: DatabaseDep, identity: Viewer, study: str) -> Response:
    """What every column means."""
    with database.read() as session:
        text = b"".join(
            FORMATS["codebook"](session, find_study(session, study, identity, "view"), EVERYTHING)
        )
    headers = {"content-disposition": f'attachment; filename="{study}-codebook.md"'}
    return Response(text, media_type="text/markdown; charset=utf-8", headers=headers)


@router.get("/{table}.{ending}", response_class=FileResponse)
def download_converted(
    asked: Asked, table: Literal["ratings", "wide"], ending: Literal["sav", "parquet"]
) -> FileResponse:
    """One row per play, or the wide table, for SPSS or as Parquet: with labels of variables and levels."""
    # The last route of this file: its path would match those of the other downloads.
    form = CONVERTED[table, ending]
    if not _converting.acquire(blocking=False):
        raise Conflict("Another SPSS or Parquet file is being made. Try again in a moment.")
    folder = Path(tempfile.mkdtemp(prefix="export-"))
    try:
        asked.note(form)
        rows = asked.write(CONVERSIONS[form], folder)
        file = convert(folder, ending)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    finally:
        _converting.release()
    return FileResponse(
        file,
        media_type="application/octet-stream",
        filename=asked.file_name(form, f"{table}.{ending}"),
        headers={ROWS_HEADER: str(rows)},
        background=BackgroundTask(shutil.rmtree, folder, ignore_errors=True),
    )


# The capsule of a study: everything that can be handed on, in one zip.

capsule_router = APIRouter(
    prefix="/api/admin/studies/{study}/capsules", tags=["data"], responses=ERROR_RESPONSES
)


@capsule_router.get("")
def list_capsules(services: ServicesDep, identity: Viewer, study: str) -> list[CapsuleOut]:
    """The latest capsules, the newest first."""
    with services.database.read() as session:
        return capsule_service.capsules(services.settings, services.locks, session, study, identity)


@capsule_router.post("", status_code=202)
def build_study_capsule(services: ServicesDep, identity: Writer, study: str, body: NewCapsule) -> CapsuleOut:
    """Begin a capsule: Psych-DS and RO-Crate with data, clips, definition, seal, plan and report."""
    return capsule_service.start(
        services.database, services.settings, services.clips, services.locks, study, body, identity
    )


@capsule_router.get("/{capsule}.zip", response_class=FileResponse)
def get_capsule(
    database: DatabaseDep, settings: SettingsDep, identity: ReportReader, study: str, capsule: str
) -> FileResponse:
    """A finished capsule. Anybody can verify it with `analysis verify`."""
    with database.read() as session:
        path = capsule_service.capsule_file(settings, session, study, identity, capsule)
    return FileResponse(path, filename=f"{study}-capsule.zip", media_type="application/zip")


@capsule_router.delete("/{capsule}", status_code=204)
def remove_capsule(services: ServicesDep, identity: Writer, study: str, capsule: str) -> None:
    """Delete a capsule for good; one that is being made is left alone."""
    capsule_service.remove(services.database, services.settings, services.locks, study, capsule, identity)


# The analysis report of a study, built on request.

report_router = APIRouter(
    prefix="/api/admin/studies/{study}/reports", tags=["reports"], responses=ERROR_RESPONSES
)


@report_router.get("")
def list_reports(services: ServicesDep, identity: Viewer, study: str) -> list[ReportOut]:
    """The latest reports, the newest first."""
    with services.database.read() as session:
        return report_service.reports(services.settings, services.locks, session, study, identity)


@report_router.post("", status_code=202)
def build_report(services: ServicesDep, identity: Writer, study: str, body: NewReport) -> ReportOut:
    """Begin a report: exclusions, the paper's table, every test, figures."""
    return report_service.start(services.database, services.settings, services.locks, study, body, identity)


@report_router.get("/{report}/{file}", response_class=FileResponse)
def get_report_file(
    services: ServicesDep, identity: ReportReader, study: str, report: str, file: str, download: bool = False
) -> FileResponse:
    """One file of a finished report: needs the right `export`, for it holds rows of single persons."""
    with services.database.read() as session:
        path = report_service.report_file(
            services.settings, services.locks, session, study, identity, report, file
        )
    kind = "attachment" if download or path.suffix != ".html" else "inline"
    headers = {"content-security-policy": report_service.REPORT_POLICY}
    return FileResponse(path, filename=f"{study}-{path.name}", content_disposition_type=kind, headers=headers)


# The sealed plan of a study on the dashboard: seal it, look at it, take it away.

seal_router = APIRouter(prefix="/api/admin/studies/{study}/seal", tags=["data"], responses=ERROR_RESPONSES)


class NewSeal(BaseModel):
    """What is sealed with the plan."""

    model_config = ConfigDict(extra="forbid")
    power: Annotated[dict[str, Any], Field(max_length=1000)] | None = Field(
        default=None, description="Output of `analysis power --json`."
    )


class SealOut(BaseModel):
    """Whether the plan of the active version's data series is sealed, and since when."""

    sealed_at: str | None
    sha256: str | None
    version: int | None
    power: bool = Field(description="Whether power was sealed with the plan.")
    participants: int = Field(
        description="Number of participants in this series; a plan cannot be sealed after the first."
    )


@seal_router.get("")
def get_seal(database: DatabaseDep, identity: Viewer, study: str) -> SealOut:
    """Whether there is a sealed plan."""
    with database.read() as session:
        known = find_study(session, study, identity, "view")
        return _seal_out(seal_of(session, known), people_begun(session, known))


def _seal_out(seal: Seal | None, people: int) -> SealOut:
    if seal is None:
        return SealOut(sealed_at=None, sha256=None, version=None, power=False, participants=people)
    return SealOut(
        sealed_at=seal.sealed_at,
        sha256=seal.sha256,
        version=seal.version,
        power=seal.power is not None,
        participants=people,
    )


@seal_router.post("", status_code=201)
def seal_study(database: DatabaseDep, identity: Writer, study: str, body: NewSeal) -> SealOut:
    """Seal design, exclusions, analysis plan and power, once, before the first participant."""
    with database.write() as session:
        # Nobody has begun: else it would not be sealed.
        return _seal_out(
            seal_plan(session, find_study(session, study, identity, "edit"), identity, body.power), people=0
        )


@seal_router.get("/plan.{ending}", response_class=Response)
def download_seal(
    database: DatabaseDep, identity: Viewer, study: str, ending: Literal["json", "html"]
) -> Response:
    """The sealed file, or a page of it that prints well."""
    seal = _seal_of_study(database, study, identity)
    text, kind = (seal.text(), "application/json") if ending == "json" else (page(seal), "text/html")
    headers = {"content-disposition": f'attachment; filename="{study}-seal.{ending}"'}
    return Response(encode_text(text), media_type=f"{kind}; charset=utf-8", headers=headers)


def _seal_of_study(database: Database, study: str, identity: Identity) -> Seal:
    with database.read() as session:
        seal = seal_of(session, find_study(session, study, identity, "view"))
    if seal is None:
        raise NotFound(f"The plan of '{study}' is not sealed.")
    return seal
