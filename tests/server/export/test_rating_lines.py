"""ratings.csv is put together from what runs and clips share; its bytes are those of the view's rows."""

import re
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from experiments.columns import Column, View
from experiments.columns.base import rows_of
from experiments.columns.view import Stretches
from experiments.kinds import views
from experiments.kinds.continuous_rating import CONTINUOUS_RATING
from server.context import Services
from server.exports import csv_lines
from server.exports.csv_lines import ExportBrokenOff, csv_pieces, rating_table
from server.exports.formats import ratings_csv
from server.exports.schemas import EVERYTHING, Extract
from server.models import Rating, Study, StudyRun, VersionClip
from server.rehearsals.person import Person, Rater
from tests.conftest import REPOSITORY
from tests.helpers.motion_checks import checked
from tests.helpers.simulated import Api, levels_by_clip
from tests.helpers.studies import SHORT, Participant, StudyInDatabase, add_study
from tests.helpers.thresholds import TWO_INTERVAL, YES_NO, text_with
from tests.server.trials.test_comparisons import IN_GROUPS
from tests.server.trials.test_scales import STUDY as SEVERAL_SCALES

TRACES = re.sub(r"(?s)\[trial\].*?(?=\[\[exclusions)", lambda _: CONTINUOUS_RATING.example + "\n", SHORT)
STUDIES = {
    "one scale, motion checks": checked(SHORT),
    "several scales": SEVERAL_SCALES,
    "a reference": (REPOSITORY / "experiments" / "dcr-demo.toml").read_text(encoding="utf-8"),
    "pairs between groups": IN_GROUPS,
    "traces": TRACES,
    "thresholds, yes or no": text_with(SHORT, YES_NO),
    "thresholds, two intervals": text_with(SHORT, TWO_INTERVAL),
}
AWKWARD = ['with "quotes", commas', "two\nlines\r\n", "Lidschlag äöü 👁", "", " ", None, "\r", "'", '""']


@pytest.fixture(params=STUDIES)
def filled(request: pytest.FixtureRequest, client: TestClient, services: Services, tmp_path: Path) -> Study:
    """A study of every kind with people of all origins, whose texts are hard to write as CSV."""
    study = add_study(services, tmp_path / "clips", STUDIES[request.param], frames=120)
    took_part(client, study, seeds=(1, 2), synthetic=True)
    took_part(client, study, seeds=(3,), synthetic=False)
    study.change(status="pilot")
    took_part(client, study, seeds=(4,), synthetic=False)
    with services.database.write() as session:
        for number, rating in enumerate(session.query(Rating).order_by(Rating.id)):
            rating.comment = AWKWARD[number % len(AWKWARD)]
            rating.viewing_distance_mm = [None, 1e16, 1 / 3, 600.0][number % 4]
        for number, run in enumerate(session.query(StudyRun).order_by(StudyRun.id)):
            run.exclusion_reason, run.excluded = AWKWARD[number % len(AWKWARD)], number % 2 == 0
            run.device = {"user_agent": ["Firefox/140.0", "Chrome/146.0", "Version/26.0"][number % 3]}
        for number, clip in enumerate(session.query(VersionClip).order_by(VersionClip.id)):
            clip.file = f"{number}, {AWKWARD[number % 3]}"
        return session.query(Study).one()


def took_part(client: TestClient, study: StudyInDatabase, seeds: tuple[int, ...], synthetic: bool) -> None:
    link, levels = study.link(synthetic=synthetic), levels_by_clip(study.services)
    for seed in seeds:
        assert Person(Api(client), Rater(seed, 1, levels)).take_part(link)


EXTRACTS = (EVERYTHING, Extract("all", 1), Extract("all", old_order=True))


def test_the_text_is_that_of_the_views_rows(services: Services, filled: Study) -> None:
    with services.database.read() as session:
        for extract in (*EXTRACTS, *map(Extract, ("participant", "pilot", "simulated"))):
            expected = b"".join(csv_pieces(rating_table(session, filled, extract)))
            assert b"".join(ratings_csv(session, filled, extract)) == expected
            assert expected.count(b"\n") > 4


def test_clips_that_no_longer_fit_in_memory_are_read_again(
    participant: Participant, services: Services, monkeypatch: pytest.MonkeyPatch
) -> None:
    participant.agree().rate_all()
    monkeypatch.setattr(csv_lines, "CLIPS_KEPT", 2)
    with services.database.read() as session:
        study = session.query(Study).one()
        expected = b"".join(csv_pieces(rating_table(session, study, EVERYTHING)))
        assert b"".join(ratings_csv(session, study, EVERYTHING)) == expected


def test_lines_that_are_missing_break_the_export_off(
    participant: Participant, services: Services, monkeypatch: pytest.MonkeyPatch
) -> None:
    participant.agree().rate_all()
    monkeypatch.setattr("server.exports.csv_lines.rating_count", lambda *_: 13)
    with (
        services.database.read() as session,
        pytest.raises(ExportBrokenOff, match="expected 13 rows, got 12"),
    ):
        list(ratings_csv(session, session.query(Study).one(), EVERYTHING))


def test_what_a_column_names_shows_what_it_is_of() -> None:
    columns = (
        Column("of_answer", "text", "Of the answer.", source="t.payload", member="choice"),
        Column("of_run", "text", "Of the run.", source="s.name || v.number"),
        Column("of_pair", "text", "Of two clips.", source="coalesce(lc.cell, rc.cell)"),
        Column("of_both", "text", "Of run and clip.", source="r.language || lc.cell"),
        Column("of_nothing", "text", "The same everywhere.", source="1 + 1"),
    )
    view = View("pairs", "Pairs.", columns, rows_of("pairs", {"left": "lc", "right": "rc"}))
    answer, run, pair, mixed = Stretches(view, "sqlite").all
    assert (answer.of_answer, run.of_run, pair.clips, mixed.of_answer) == (True, True, ("lc", "rc"), True)
    assert [column.name for column in mixed.columns] == ["of_both", "of_nothing"]


@pytest.mark.parametrize("view", views(), ids=lambda view: view.name)
def test_every_view_shares_what_its_runs_and_clips_have(view: View) -> None:
    stretches = Stretches(view, "postgresql").all
    assert [column for one in stretches for column in one.columns] == list(view.columns)
    of_run = {column.name for one in stretches if one.of_run for column in one.columns}
    assert {"study", "run", "participant", "run_status", "run_origin", "exclusion_reason"} <= of_run
    assert any(one.clips for one in stretches)
