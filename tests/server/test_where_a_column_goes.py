"""What a new column costs, shown on a copy of the tree: a declaration, and no migration.

Generated files (`make docs`) are not counted; docs/explanation/architecture.md has the number.
"""

import difflib
import json
import sys
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from server.app import create_app
from server.context import open_services
from server.core.migrate import is_up_to_date, upgrade
from server.core.settings import Settings
from server.rehearsals.person import Person, Rater
from tests.conftest import REPOSITORY
from tests.experiments.additions.added import COLUMN, Edit
from tests.experiments.additions.tree import add, copy_tree, ran
from tests.experiments.additions.whole import KEY
from tests.helpers.databases import BACKENDS
from tests.helpers.simulated import Api
from tests.helpers.studies import SHORT, add_study

MOST_LINES = 10


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The tree with a column more."""
    folder = tmp_path_factory.mktemp("tree")
    copy_tree(folder)
    add(folder, COLUMN)
    return folder


def test_a_column_is_so_few_lines_of_one_file() -> None:
    [edit] = COLUMN.values()
    assert isinstance(edit, Edit)
    lines = difflib.ndiff(edit.before.splitlines(), edit.after.splitlines())
    assert 0 < sum(line[0] in "+-" for line in lines) <= MOST_LINES
    page = (REPOSITORY / "docs" / "explanation" / "architecture.md").read_text(encoding="utf-8")
    [row] = [line for line in page.splitlines() if line.startswith("| column |")]
    assert f"| 1 changed, of at most {MOST_LINES} lines." in row


@pytest.mark.parametrize("empty_database_url", BACKENDS, indirect=True)
def test_a_column_comes_to_a_database_that_is_there_by_the_next_start(
    copy: Path, empty_database_url: str, tmp_path: Path
) -> None:
    settings = Settings(data_folder=tmp_path, database_url=empty_database_url, secret_key=KEY)
    services = open_services(settings)
    upgrade(services.database)
    study = add_study(services, tmp_path / "clips", SHORT)
    with TestClient(create_app(settings)) as client:
        assert Person(Api(client), Rater(1, 1, {})).take_part(study.link(synthetic=True))
    with services.database.write_connection() as connection:
        connection.exec_driver_sql("UPDATE trial_ratings SET comment = 'quick' WHERE trial_index = 1")
    services.database.close()
    done = ran(
        copy,
        sys.executable,
        *("-m", "tests.experiments.additions.exports", empty_database_url, str(tmp_path), "comment_length"),
    )
    assert done.returncode == 0, done.stderr[-3000:]
    seen = json.loads(done.stdout)
    assert seen["view"].count(5) == 1
    assert seen["csv"] == ["" if value is None else str(value) for value in seen["view"]]
    assert len(seen["csv"]) > 5
    assert "Characters of the comment." in seen["codebook"][0]
    assert "Characters of the comment." in seen["dictionary"][0]
    # This program, which knows no such column, has its own views again after its next start.
    assert not is_up_to_date(services.database)
    upgrade(services.database)
    assert is_up_to_date(services.database)
    services.database.close()
