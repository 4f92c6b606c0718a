"""`analysis run NAME` of a shipped study that was edited: the definition that its answers were given to."""

import json
import uuid
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import make_url, text
from typer.testing import CliRunner

from analysis.cli import app
from experiments.errors import InputError
from experiments.load import locate, parse_experiment
from server.app import create_app
from server.context import Services
from server.rehearsals.person import Person, Rater
from server.studies.creation import add_version, create_study, store_clips
from server.studies.links import create_link
from server.studies.repository import study_called
from tests.helpers.databases import BACKENDS
from tests.helpers.simulated import Api
from tests.helpers.studies import link_token
from tests.helpers.tiny_clips import make_clip_folder

PAIRS = locate("pairs-demo").read_text("utf-8")
RATED = """kind = "clip_rating"
expected_seconds = 8.0
scale = { question = { en = "How natural?", de = "Wie natürlich?" }, low = { en = "not", de = "nicht" }, \
high = { en = "very", de = "sehr" } }

[display]"""
RATINGS = (
    PAIRS[: PAIRS.index('kind = "paired')] + RATED + PAIRS[PAIRS.index("[display]") + len("[display]") :]
)
REWORDED = PAIRS.replace("Which blink looked more natural?", "Which blink was more natural?")
PEOPLE = 5


def save_and_answer(services: Services, toml: str, folder: Path, name: str = "lids") -> None:
    """Save this definition as the study's next version, and let simulated people answer it."""
    experiment = parse_experiment(toml)
    manifest = make_clip_folder(experiment, folder, frames=4)
    store_clips(services.clips, manifest, folder)
    with services.database.write() as session:
        study = study_called(session, name) or create_study(session, name, experiment, None)
        add_version(session, study, toml, experiment, manifest, None)
        study.status = "live"
        link = link_token(
            services, create_link(session, services.settings.key, study, "general", synthetic=True)
        )
    with TestClient(create_app(services.settings)) as client:
        for seed in range(PEOPLE):
            assert Person(Api(client), Rater(seed, 1, {})).take_part(link)


def run(url: str, *arguments: object):
    command = ["run", "pairs-demo", "--database", url, *map(str, arguments)]
    return CliRunner().invoke(app, command, catch_exceptions=False)


def test_a_study_whose_kind_of_trial_was_changed_is_analysed_as_the_kind_of_its_answers(
    services: Services, database_url: str, tmp_path: Path
) -> None:
    save_and_answer(services, REWORDED, tmp_path / "one")
    save_and_answer(services, RATINGS, tmp_path / "two")
    newest = run(database_url, "--no-report", "--json", tmp_path / "a.json")
    assert newest.exit_code == 0, newest.output
    said = "Study 'lids' was edited: its own definition (version 2) is used, not the shipped pairs_demo"
    assert said in " ".join(newest.stderr.split())
    found = json.loads((tmp_path / "a.json").read_text())
    assert [effect["effect"] for effect in found["effects"]] == ["character", "blink", "character:blink"]
    assert found["n_participants"] == PEOPLE
    # Also where it is asked for by its number, or by its version's.
    for option in ("--series", "--version"):
        same = run(database_url, "--no-report", option, 2)
        assert "Mean ratings by condition" in " ".join(same.stdout.split())
        earlier = run(database_url, "--no-report", option, 1)
        assert "its own definition (version 1) is used" in " ".join(earlier.stderr.split())
        assert "Abilities" in earlier.stdout
    with pytest.raises(InputError, match=r"no responses of data series 3; it has data series 1 \(version 1"):
        run(database_url, "--no-report", "--series", 3)


def test_answers_of_another_kind_are_named_where_the_shipped_definition_has_answers(
    services: Services, database_url: str, tmp_path: Path
) -> None:
    save_and_answer(services, PAIRS, tmp_path / "one")
    save_and_answer(services, RATINGS, tmp_path / "two")
    found = run(database_url, "--no-report")
    assert "Abilities" in found.stdout
    said = "answers of another kind of trial in data series 2 were ignored; to analyze them: --series 2"
    assert said in " ".join(found.stdout.split())
    rated = " ".join(run(database_url, "--no-report", "--series", 2).stdout.split())
    assert "Mean ratings by condition" in rated
    assert "another kind of trial" not in rated


def test_ratings_alone_are_found_though_the_shipped_study_compares_pairs(
    services: Services, database_url: str, tmp_path: Path
) -> None:
    save_and_answer(services, RATINGS, tmp_path / "one")
    found = run(database_url, "--no-report")
    assert found.exit_code == 0, found.stderr
    assert "Mean ratings by condition" in " ".join(found.stdout.split())
    assert "Study 'lids' was edited" in found.stderr


def test_another_study_of_another_kind_does_not_hide_the_edit(
    services: Services, database_url: str, tmp_path: Path
) -> None:
    """Of two studies with this experiment's name, the one with trials of the shipped kind is meant."""
    save_and_answer(services, REWORDED, tmp_path / "one")
    save_and_answer(services, RATINGS, tmp_path / "two", "rated lids")
    found = run(database_url, "--no-report")
    assert found.exit_code == 0, found.stderr
    assert "Study 'lids' was edited: its own definition (version 1)" in " ".join(found.stderr.split())
    rated = run(database_url, "--no-report", "--study", "rated lids")
    assert "Study 'rated lids' was edited" in " ".join(rated.stderr.split())
    assert "Mean ratings by condition" in " ".join(rated.stdout.split())
    save_and_answer(services, PAIRS, tmp_path / "three", "more lids")
    with pytest.raises(InputError, match="holds 2 studies; choose one with --study: lids, more lids"):
        run(database_url, "--no-report")


def test_the_report_says_that_an_edited_definition_was_used(
    services: Services, database_url: str, tmp_path: Path
) -> None:
    save_and_answer(services, REWORDED, tmp_path / "one")
    done = run(database_url, "--out", tmp_path / "report")
    assert done.exit_code == 0, done.output
    said = "study 'lids' was edited: its own definition (version 1) is used, not the shipped pairs_demo"
    assert said in " ".join(done.stdout.split())
    report = (tmp_path / "report" / "report.md").read_text("utf-8")
    assert said[1:] in " ".join(report[report.index("Exclusions and decisions") :].split())


@pytest.mark.parametrize("database_url", BACKENDS[1:], indirect=True)
def test_a_user_who_may_read_the_view_alone_analyses_a_study_as_shipped(
    services: Services, database_url: str, tmp_path: Path
) -> None:
    save_and_answer(services, PAIRS, tmp_path / "one")
    role = f"reader_{uuid.uuid4().hex[:8]}"

    def order(*statements: str) -> None:
        with services.database.engine.begin() as connection:
            for statement in statements:
                connection.execute(text(statement))

    # Without row security a view reads its tables with the rights of the view's owner.
    reset = "ALTER VIEW comparisons RESET (security_invoker)"
    order(reset, f"CREATE ROLE {role}", f"GRANT SELECT ON comparisons TO {role}")
    try:
        url = make_url(database_url).update_query_dict({"options": f"-c role={role}"})
        found = run(url.render_as_string(hide_password=False), "--no-report")
        assert found.exit_code == 0, found.output
        assert found.stdout == run(database_url, "--no-report").stdout
        save_and_answer(services, REWORDED, tmp_path / "two")
        with pytest.raises(InputError, match=r"its definition cannot be read there; give its TOML file"):
            run(url.render_as_string(hide_password=False), "--no-report", "--series", 2)
    finally:
        restored = "ALTER VIEW comparisons SET (security_invoker = true)"
        order(restored, f"REVOKE ALL ON comparisons FROM {role}", f"DROP ROLE {role}")
