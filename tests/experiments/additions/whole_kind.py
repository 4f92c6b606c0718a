"""The added kind of trial, from its declaration over HTTP to Results and the report: prints JSON."""

import json
import sys
from pathlib import Path
from typing import Any

from fastapi.testclient import TestClient

from analysis.plans.plan import plan_of, study_contents
from analysis.read.study_answers import load_csv
from analysis.report.write import write_report
from experiments.kinds import KINDS
from server.accounts.identity import OPERATOR
from server.app import create_app
from server.context import open_services
from server.core.migrate import upgrade
from server.core.settings import Settings
from server.exports.formats import FORMATS
from server.exports.schemas import Extract
from server.rehearsals.person import Person, Rater
from server.results.kinds import summary_of
from server.results.repository import Pool
from server.studies.lookup import active_version, find_study
from tests.helpers.simulated import Api
from tests.helpers.studies import SHORT, add_study

KIND = KINDS["word_choice"]
TEXT = SHORT[: SHORT.index("[trial]")] + KIND.example + SHORT[SHORT.index("[[exclusions]]") :]
PEOPLE = 3


def main(folder: Path) -> dict[str, Any]:
    """What each step gave."""
    url = f"sqlite:///{folder / 'kind.sqlite'}"
    settings = Settings(data_folder=folder, database_url=url, secret_key="a key of the tests, long enough")
    services = open_services(settings)
    upgrade(services.database)
    study = add_study(services, folder / "clips", TEXT)
    link = study.link(synthetic=True)
    with TestClient(create_app(settings)) as client:
        for seed in range(PEOPLE):
            assert Person(Api(client), Rater(seed, 1, {})).take_part(link)
    with services.database.read() as session:
        stored = find_study(session, "short", OPERATOR, "view")
        table = b"".join(FORMATS["csv"](session, stored, Extract("simulated")))
        codebook = b"".join(FORMATS["codebook"](session, stored, Extract("all"))).decode()
        version = active_version(session, stored)
        results = summary_of("word_choice")(
            session, stored, version, Pool(stored.id, "simulated", version.series, "")
        )
    (folder / "words.csv").write_bytes(table)
    answers = load_csv(folder / "words.csv", study.experiment, plan_of("word_choice").reading)
    contents = study_contents(study.experiment, answers)
    services.database.close()
    return {
        "codebook": codebook,
        "results": results.model_dump(mode="json"),
        "numbers": contents.numbers,
        "report": [path.name for path in write_report(contents, folder / "report")],
    }


if __name__ == "__main__":
    sys.stdout.write(json.dumps(main(Path(sys.argv[1]))))
