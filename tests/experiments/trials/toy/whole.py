"""Declare, plan, simulate over HTTP, store, export, analyze, read again: the toy in a separate process.

What follows the imports below is all that joins it: the line that a new kind has in the registry, and the
places where files are found by a kind's name.
"""

import json
import sys
from pathlib import Path
from typing import Any

from experiments import kinds
from experiments.declaration.any_trial import TRIALS
from experiments.declaration.experiment import Experiment
from tests.experiments.trials.toy import TOY

kinds.KINDS[TOY.name] = TOY
TRIALS[TOY.name] = TOY.declaration
# A kind that is in the registry from the start needs no such line: the model was made before the toy came.
Experiment.model_rebuild(force=True)

import analysis.plans  # noqa: E402
import server.participation.kinds  # noqa: E402

HERE = Path(__file__).parent
server.participation.kinds.__path__.append(str(HERE / "served"))
analysis.plans.__path__.append(str(HERE / "plans"))

from fastapi.testclient import TestClient  # noqa: E402

from analysis.plans.plan import plan_of, study_contents  # noqa: E402
from analysis.read.database import load_database  # noqa: E402
from analysis.read.study_answers import load_csv  # noqa: E402
from analysis.report.write import write_report  # noqa: E402
from experiments.load import load_stored  # noqa: E402
from experiments.schema.stored import FORMAT  # noqa: E402
from server.accounts.identity import OPERATOR  # noqa: E402
from server.app import create_app  # noqa: E402
from server.context import open_services  # noqa: E402
from server.core.migrate import upgrade  # noqa: E402
from server.core.settings import Settings  # noqa: E402
from server.exports.formats import FORMATS  # noqa: E402
from server.exports.schemas import Extract  # noqa: E402
from server.rehearsals.person import Person, Rater  # noqa: E402
from server.results.kinds import summary_of  # noqa: E402
from server.results.repository import Pool  # noqa: E402
from server.studies.lookup import active_definition, active_version, find_study  # noqa: E402
from tests.helpers.simulated import Api  # noqa: E402
from tests.helpers.studies import SHORT, add_study  # noqa: E402

TEXT = SHORT[: SHORT.index("[trial]")] + TOY.example + SHORT[SHORT.index("[[exclusions]]") :]
PEOPLE = 3


def main(folder: Path) -> dict[str, Any]:
    """What each step gave."""
    url = f"sqlite:///{folder / 'toy.sqlite'}"
    settings = Settings(data_folder=folder, database_url=url, secret_key="a key of the tests, long enough")
    services = open_services(settings)
    upgrade(services.database)
    study = add_study(services, folder / "clips", TEXT)
    link = study.link(synthetic=True)
    with TestClient(create_app(settings)) as client:
        for seed in range(PEOPLE):
            assert Person(Api(client), Rater(seed, 1, {})).take_part(link)
    found: dict[str, Any] = {"plan": list(TOY.plan(study.experiment))}
    with services.database.read() as session:
        stored = find_study(session, "short", OPERATOR, "view")
        table = b"".join(FORMATS["csv"](session, stored, Extract("simulated")))
        found["codebook"] = b"".join(FORMATS["codebook"](session, stored, Extract("all"))).decode()
        found["psych_ds"] = sum(map(len, FORMATS["psych-ds"](session, stored, Extract("simulated"))))
        version, definition = active_version(session, stored), active_definition(session, stored)
        found["read_again"] = load_stored(version.definition, FORMAT) == definition
        pool = Pool(stored.id, "simulated", version.series, "")
        results = summary_of(TOY.name)(session, stored, version, pool)
        found["results"] = {"kind": results.kind, "answers": results.ratings}
    (folder / "sameness.csv").write_bytes(table)
    reading = plan_of(TOY.name).reading
    for source, answers in (
        ("csv", load_csv(folder / "sameness.csv", study.experiment, reading)),
        ("database", load_database(url, study.experiment, reading)),
    ):
        contents = study_contents(study.experiment, answers)
        found[source] = contents.numbers
    found["report"] = [path.name for path in write_report(contents, folder / "report")]
    found["rows"] = len(table.decode().splitlines()) - 1
    services.database.close()
    return found


if __name__ == "__main__":
    sys.stdout.write(json.dumps(main(Path(sys.argv[1]))))
