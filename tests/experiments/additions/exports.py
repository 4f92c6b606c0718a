"""What a tree exports of a database that is there: run in a copy of the tree, it prints JSON."""

import json
import sys
from csv import DictReader
from io import StringIO
from pathlib import Path
from typing import Any

from sqlalchemy import text

from server.accounts.identity import OPERATOR
from server.cli_common import migrated_services
from server.core.settings import Settings
from server.exports.formats import FORMATS
from server.exports.schemas import Extract
from server.studies.lookup import find_study
from tests.experiments.additions.whole import KEY
from tools.reference import data_dictionary


def main(url: str, folder: Path, column: str) -> dict[str, Any]:
    """The column's values in the view and in the CSV, and where it is described."""
    settings = Settings(data_folder=folder, database_url=url, secret_key=KEY)
    # As every command of the server and its start begin.
    with migrated_services(settings) as services, services.database.read() as session:
        study = find_study(session, "short", OPERATOR, "view")
        table = b"".join(FORMATS["csv"](session, study, Extract("simulated"))).decode("utf-8-sig")
        codebook = b"".join(FORMATS["codebook"](session, study, Extract("all"))).decode()
        in_view = session.scalars(text(f"SELECT {column} FROM ratings ORDER BY run, trial_index, play"))
        return {
            "view": in_view.all(),
            "csv": [row[column] for row in DictReader(StringIO(table))],
            "codebook": [line for line in codebook.splitlines() if column in line],
            "dictionary": [line for line in data_dictionary().splitlines() if f"`{column}`" in line],
        }


if __name__ == "__main__":
    sys.stdout.write(json.dumps(main(sys.argv[1], Path(sys.argv[2]), sys.argv[3])))
