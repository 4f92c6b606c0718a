"""The analysis of what a real browser's visit stored, straight from the server's database."""

from pathlib import Path

from typer.testing import CliRunner

from analysis.cli import app
from tests.browser.server_process import ServerProcess


def analysed(server: ServerProcess, study: str, folder: Path) -> str:
    """What `analysis run` says of a study's participants, by the definition that the server stored."""
    statement = (
        "SELECT definition_toml AS text FROM study_versions v JOIN studies s ON s.id = v.study_id "
        f"WHERE s.name = '{study}'"
    )
    declaration = folder / f"{study}.toml"
    declaration.write_text(server.rows(statement)[0]["text"], encoding="utf-8")
    options = [
        "--database",
        server.settings.resolved_database_url,
        "--origin",
        "participant",
        "--no-report",
    ]
    done = CliRunner().invoke(app, ["run", str(declaration), *options])
    assert done.exit_code == 0, f"{done.output}{done.exception!r}"
    return done.output
