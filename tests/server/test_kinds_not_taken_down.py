"""A database that holds answers of a newer kind is not taken down to a revision that does not know it."""

from collections.abc import Callable
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import text

from server.context import Services
from server.core.migrate import current_revision, downgrade, newest_revision
from server.rehearsals.person import Person, Rater
from tests.helpers.simulated import Api
from tests.helpers.studies import SHORT, add_study
from tests.helpers.thresholds import YES_NO, text_with
from tests.server.trials.test_comparisons import PAIRS
from tests.server.trials.test_scales import STUDY as SCALES


def thresholds() -> str:
    return text_with(SHORT, YES_NO)


@pytest.mark.parametrize(
    ("declared", "revision"),
    [(lambda: PAIRS, "0007"), (thresholds, "0008"), (lambda: SCALES, "0012")],
    ids=["pairs", "thresholds", "scales"],
)
def test_it_says_so_in_one_line_and_nothing_is_changed(
    services: Services, client: TestClient, tmp_path: Path, declared: Callable[[], str], revision: str
) -> None:
    study = add_study(services, tmp_path / "clips", declared())
    person = Person(Api(client), Rater(1, 1, {}))
    assert person.take_part(study.link(synthetic=True), stop_after=3) is None
    with services.database.read() as session:
        before = session.execute(text("SELECT rating_id, kind FROM trial_ratings ORDER BY 1")).all()
    assert len(before) == 3
    with pytest.raises(RuntimeError, match="keep this revision, or take a backup and delete") as raised:
        downgrade(services.database, revision)
    assert "\n" not in str(raised.value)
    assert current_revision(services.database) == newest_revision()
    with services.database.read() as session:
        assert session.execute(text("SELECT rating_id, kind FROM trial_ratings ORDER BY 1")).all() == before
