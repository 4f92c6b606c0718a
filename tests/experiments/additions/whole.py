"""A study with the added types, from its declaration over HTTP to the export and the report."""

import json
import sys
from csv import DictReader
from io import StringIO
from pathlib import Path
from typing import Any

from fastapi.testclient import TestClient

from analysis.plans.plan import plan_of, study_contents
from analysis.read.study_answers import load_csv
from analysis.report.write import write_report
from server.accounts.identity import OPERATOR
from server.app import create_app
from server.context import open_services
from server.core.migrate import upgrade
from server.core.settings import Settings
from server.exports.formats import FORMATS
from server.exports.schemas import Extract
from server.rehearsals.person import Person, Rater
from server.studies.lookup import find_study
from tests.helpers.simulated import Api
from tests.helpers.studies import SHORT, add_study

FIELD = """\
[[forms.fields]]
type = "decimal"
name = "dioptres"
label = { en = "How strong are your glasses?" }
minimum = -20.0
maximum = 20.0

[[forms.fields]]
"""
TRIAL = """\
[[trial.scales]]
name = "speed"
type = "magnitude"
minimum = 10.0
maximum = 500.0
unit = { en = "ms", de = "ms" }
question = { en = "How long did it take?", de = "Wie lange dauerte es?" }

"""
KEY = "a key of the tests, long enough"


def main(folder: Path) -> dict[str, Any]:
    """Answers as they are stored, and the names of what is reported."""
    start, end = SHORT.index("[trial.scale]"), SHORT.index("[[exclusions]]")
    text = (SHORT[:start] + TRIAL + SHORT[end:]).replace("[[forms.fields]]\n", FIELD, 1)
    url = f"sqlite:///{folder / 'added.sqlite'}"
    settings = Settings(data_folder=folder, database_url=url, secret_key=KEY)
    services = open_services(settings)
    upgrade(services.database)
    study = add_study(services, folder / "clips", text)
    link = study.link(synthetic=True)
    with TestClient(create_app(settings)) as client:
        for seed in range(3):
            assert Person(Api(client), Rater(seed, 1, {})).take_part(link)
    with services.database.read() as session:
        stored = find_study(session, "short", OPERATOR, "view")
        table = b"".join(FORMATS["csv"](session, stored, Extract("simulated")))
        runs = b"".join(FORMATS["runs"](session, stored, Extract("simulated"))).decode()
        codebook = b"".join(FORMATS["codebook"](session, stored, Extract("all"))).decode()
    (folder / "ratings.csv").write_bytes(table)
    services.database.close()
    rows = [row for row in DictReader(StringIO(table.decode())) if row["scale"]]
    answers = load_csv(folder / "ratings.csv", study.experiment, plan_of("clip_rating").reading)
    contents = study_contents(study.experiment, answers)
    return {
        "responses": [float(row["response"]) for row in rows],
        "dioptres": [float(row["form_about_dioptres"]) for row in DictReader(StringIO(runs))],
        "codebook": codebook,
        "report": [path.name for path in write_report(contents, folder / "report")],
    }


if __name__ == "__main__":
    sys.stdout.write(json.dumps(main(Path(sys.argv[1]))))
