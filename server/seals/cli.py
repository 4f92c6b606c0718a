"""`server seal`: fix the plan of a study before its first participant."""

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from experiments.errors import InputError
from experiments.files import whole_text
from server.accounts.identity import OPERATOR
from server.cli_common import out, stored_services
from server.seals.page import page
from server.seals.service import seal_of, seal_plan
from server.studies.lookup import find_study


def register(parent: typer.Typer) -> None:
    """Add `server seal` to the command line."""
    parent.command("seal")(seal)


def seal(
    study: Annotated[str, typer.Argument(help="Name of the study.")],
    out_file: Annotated[
        Path, typer.Option("--out", help="JSON file to write; a page to print stands beside.")
    ],
    power: Annotated[
        Path | None, typer.Option(help="JSON of `analysis power --json`, to be sealed with the plan.")
    ] = None,
) -> None:
    """Seal design, exclusions, analysis plan and power before the first participant; or write the seal again.

    Examples:

      server seal exp3 --out exp3-seal.json

      analysis run exp3.toml --csv exp3.csv --seal exp3-seal.json
    """
    planned = _power(power)
    with stored_services() as services, services.database.write() as session:
        known = find_study(session, study, OPERATOR, "view")
        sealed = seal_of(session, known) or seal_plan(session, known, None, planned)
    if planned is not None and sealed.power != planned:
        raise InputError(
            f"the plan was sealed {sealed.sealed_at} with another power; a seal is never replaced"
        )
    for path, text in ((out_file, sealed.text()), (out_file.with_suffix(".html"), page(sealed))):
        with whole_text(path) as stream:
            stream.write(text)
    out.print(f"{out_file}: sealed {sealed.sealed_at}, sha256 {sealed.sha256}")


def _power(path: Path | None) -> dict[str, Any] | None:
    if path is None:
        return None
    try:
        power = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: expected the JSON of `analysis power` ({error})") from error
    if not isinstance(power, dict):
        raise InputError(f"{path}: expected the JSON of `analysis power`, got a list or a number")
    return power
