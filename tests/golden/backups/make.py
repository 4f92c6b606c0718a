"""Write the backup of the present revision; see README.md."""

import tempfile
from pathlib import Path

from fastapi.testclient import TestClient

from server.app import create_app
from server.context import open_services
from server.core.migrate import newest_revision, upgrade
from server.core.settings import Settings
from server.operations.backup import back_up
from tests.helpers.golden_backups import GOLDEN, keep_backup
from tests.helpers.studies import Participant, add_study


def main() -> None:
    """One finished visit, one begun, one whose person is known to a recruiter, with the key file."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        settings = Settings(
            data_folder=folder,
            database_url=f"sqlite:///{folder / 'x.sqlite'}",
            secret_key="golden",
            evidence="record",
        )
        services = open_services(settings)
        upgrade(services.database)
        study = add_study(services, folder / "clips")
        with TestClient(create_app(settings)) as client:
            first = Participant(client, study.link_token).agree()
            first.request("PUT", "/forms/about", {"answers": {"age": 30, "glasses": ["lenses"]}})
            first.rate_all()
            second = Participant(client, study.link_token).agree()
            second.rate(second.state()["trials"][0], comment="an open visit")
            known = Participant(client, study.link(recruiter={"kind": "sona"}))
            known.start(query={"survey_code": "40177"})
        revision = newest_revision()
        backup = folder / f"{revision}.tar"
        back_up(
            services.database,
            services.settings,
            services.clips,
            backup,
            with_clips=False,
            keys=GOLDEN / f"{revision}.keys.json",
        )
        keep_backup(backup)
        services.database.close()


if __name__ == "__main__":
    main()
