"""Tables that people already have: guess what the columns are, run an analysis, and keep nothing.

A table comes with every request and is deleted with its answer. `analysis` runs in a separate process, which
may take `LIMIT_S` seconds and `MEMORY` bytes, so that no table can take the server from its participants.
"""

import base64
import json
import re
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath
from typing import Annotated, Any

from fastapi import APIRouter
from pydantic import Base64Bytes, BaseModel, ConfigDict, Field

from server.accounts.access import Writer
from server.core.errors import ERROR_RESPONSES, ApiError, Invalid
from server.results.jobs import last_line, own_program
from table_files.delimited import TABLE_ENDINGS

router = APIRouter(prefix="/api/admin/analyses", tags=["analyses"], responses=ERROR_RESPONSES)
LIMIT_S = 60
WAIT_S = 1.0
"""Longer waits would take the few places that experimenters' requests have."""
MEMORY = 4 << 30
_one_at_a_time = threading.Lock()

Name = Annotated[str, Field(min_length=1, max_length=200)]


class AnalysisBusy(ApiError, status=503, code="busy"):
    """Another table is being analyzed."""


class OwnTable(BaseModel):
    """A table: its file name, and its bytes in Base64 (at most 12 MB)."""

    model_config = ConfigDict(extra="forbid")

    name: Name
    content: Base64Bytes


class OwnAnalysis(OwnTable):
    """A table, the analysis to run, and the role of each column that takes part."""

    command: Annotated[str, Field(max_length=40)]
    roles: Annotated[dict[str, str], Field(max_length=1000)]


class OwnColumn(BaseModel):
    """What a column holds, and the role that it probably has (empty: none)."""

    name: str
    is_number: bool
    n_values: int
    n_missing: int
    values: list[str]
    role: str


class CommandRoles(BaseModel):
    """The roles that an analysis needs, and those that it may have."""

    needed: list[str]
    optional: list[str]


class SeveralColumns(BaseModel):
    """Roles of which an analysis takes several columns, and analyses that take one all the same."""

    roles: list[str]
    not_in: list[str]


class OwnColumns(BaseModel):
    """The columns of a table, the analysis that fits them (empty: none), and the roles of each analysis."""

    n_rows: int
    columns: list[OwnColumn]
    command: str
    decisions: list[str]
    commands: dict[str, CommandRoles]
    several: SeveralColumns


class ResultTable(BaseModel):
    """A table of a result, as text cells; the first `text_columns` are words, the others numbers."""

    key: str
    title: str
    header: list[str]
    rows: list[list[str]]
    text_columns: int
    notes: list[str]
    folded: bool


class ResultFigure(BaseModel):
    """A figure of a result; `svg` and `png` are Base64."""

    key: str
    caption: str
    alt: str
    svg: str
    png: str


class OwnResult(BaseModel):
    """What an analysis shows, and the command line that gives the same."""

    command_line: str
    synthetic: bool
    sentences: list[str]
    decisions: list[str]
    tables: list[ResultTable]
    figures: list[ResultFigure]


@router.post("/columns")
def describe_columns(_: Writer, body: OwnTable) -> OwnColumns:
    """Read a table and guess what its columns are. Nothing is stored."""
    with _table_folder(body) as (folder, table):
        _run_analysis(["columns", str(table), "--json", str(folder / "columns.json")], table, body.name)
        return OwnColumns.model_validate_json((folder / "columns.json").read_bytes())


@router.post("")
def analyze_table(_: Writer, body: OwnAnalysis) -> OwnResult:
    """Run an analysis of a table: sentences, tables, figures and the command line. Nothing is stored."""
    with _table_folder(body) as (folder, table):
        roles = {column: role for column, role in body.roles.items() if role}
        asked = {"command": body.command, "roles": roles, "name": body.name}
        (folder / "roles.json").write_text(json.dumps(asked), encoding="utf-8")
        page = folder / "page"
        roles_file = str(folder / "roles.json")
        _run_analysis(["page", str(table), str(page), "--roles", roles_file], table, body.name)
        shown: dict[str, Any] = json.loads((page / "page.json").read_text(encoding="utf-8"))
        for figure in shown["figures"]:
            for kind in ("svg", "png"):
                figure[kind] = base64.b64encode((page / f"{figure['key']}.{kind}").read_bytes()).decode()
        return OwnResult.model_validate(shown)


@contextmanager
def _table_folder(body: OwnTable) -> Iterator[tuple[Path, Path]]:
    """A folder with the table, which is removed at the end; one table at a time."""
    ending = PurePosixPath(body.name).suffix.lower()
    if ending not in TABLE_ENDINGS:
        raise Invalid(f"'{body.name}' is not a table; expected a file ending in {', '.join(TABLE_ENDINGS)}")
    if not _one_at_a_time.acquire(timeout=WAIT_S):
        again = {"retry-after": "30"}
        raise AnalysisBusy("Another table is being analyzed. Try again in a minute.", headers=again)
    try:
        with tempfile.TemporaryDirectory(prefix="palpebra-table-") as scratch:
            # Tables and figures are titled with the file's name, of which only letters and digits are safe.
            stem = re.sub(r"[^\w]+", "_", PurePosixPath(body.name).stem)[:60]
            # In a folder of its name, next to which this program's own files have room.
            table = Path(scratch) / "table" / f"{stem}{ending}"
            table.parent.mkdir()
            table.write_bytes(body.content)
            yield Path(scratch), table
    finally:
        _one_at_a_time.release()


def _run_analysis(arguments: Sequence[str], table: Path, name: str) -> None:
    """Run `analysis` in the table's folder; Invalid with its error line where it refuses the table."""
    with subprocess.Popen(  # noqa: S603 - the program of this installation
        [str(own_program("analysis")), *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        cwd=table.parent,
        text=True,
        encoding="utf-8",
        errors="replace",
    ) as process:
        _limit_memory(process.pid)
        try:
            printed, _ = process.communicate(timeout=LIMIT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
            said = f"The analysis did not end within {LIMIT_S} s. Run its command on your own computer"
            raise Invalid(f"{said}, where it may take longer.") from None
    if process.returncode != 0:
        reason = last_line(printed) or "the analysis ended without a reason"
        raise Invalid(reason.replace(f"{table.parent}/", "").replace(table.name, name)[:500])


def _limit_memory(pid: int) -> None:
    """Bound the memory of a process, where the system can (Linux)."""
    if sys.platform == "linux":
        import resource

        with suppress(OSError, ValueError):  # it may have ended
            resource.prlimit(pid, resource.RLIMIT_AS, (MEMORY, MEMORY))
