import csv
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from experiments.declaration.experiment import Experiment
from experiments.load import parse_experiment
from server.context import Services
from server.exports import tables
from server.exports.csv_lines import rating_rows
from server.exports.psych_ds import LANGUAGES, script
from server.exports.schemas import EVERYTHING
from server.exports.tables import Cell, cells_of, form_columns
from server.models import Study
from server.studies.creation import add_version, store_clips
from tests.conftest import REPOSITORY
from tests.helpers.admins import Admin
from tests.helpers.studies import SHORT, Participant, StudyInDatabase, add_study
from tests.helpers.tiny_clips import make_clip_folder
from tests.server.trials.test_comparisons import PAIRS


def rows_of(admin: Admin, file: str) -> list[dict[str, Any]]:
    answer = admin.get(f"/studies/short/data/{file}")
    assert answer.status_code == 200, answer.text
    return list(csv.DictReader(io.StringIO(answer.text)))


def test_a_row_a_visit_and_the_mean_of_each_cell(viewer: Admin, participant: Participant) -> None:
    participant.agree()
    participant.request("PUT", "/forms/about", {"answers": {"age": 33, "glasses": ["lenses"]}})
    participant.rate_all()
    [row] = rows_of(viewer, "wide.csv")
    assert [row["form_about_age"], row["form_about_glasses_glasses"], row["form_about_glasses_lenses"]] == [
        "33", "0", "1",
    ]  # fmt: skip
    main = [one for one in rows_of(viewer, "ratings.csv") if one["kind"] == "main"]
    assert row["answers"] == "8" == str(len(main))
    for character in "ab":
        for speed in ("slow", "fast"):
            given = [
                float(one["response"])
                for one in main
                if (one["character"], one["speed"]) == (character, speed)
            ]
            assert float(row[f"rating_{character}_{speed}"]) == pytest.approx(sum(given) / len(given))


def test_a_visit_without_answers_has_empty_cells(viewer: Admin, participant: Participant) -> None:
    participant.agree()
    [row] = rows_of(viewer, "wide.csv")
    assert row["answers"] == "0"
    assert row["rating_a_slow"] == row["form_about_age"] == ""


def filled(row: dict[str, Any]) -> set[str]:
    return {name for name, value in row.items() if name.startswith("rating_") and value}


def rate_in_next_version(study: StudyInDatabase, participant: Participant, text: str, folder: Path) -> None:
    changed, services = parse_experiment(text), study.services
    manifest = make_clip_folder(changed, folder / "changed", frames=4)
    store_clips(services.clips, manifest, folder / "changed")
    with services.database.write() as session:
        add_version(session, session.query(Study).one(), text, changed, manifest, None)
    later = Participant(participant.client, participant.link)
    later.agree()
    later.rate_all()


SPEED = 'name = "speed"\nlabel = "Speed"\n'


def test_answers_of_an_earlier_data_series_keep_their_columns(
    viewer: Admin, study: StudyInDatabase, participant: Participant, tmp_path: Path
) -> None:
    participant.agree()
    participant.rate_all()
    rate_in_next_version(study, participant, SHORT.replace('name = "fast"', 'name = "quick"'), tmp_path)
    first, second = rows_of(viewer, "wide.csv")
    assert [row["data_series"] for row in (first, second)] == ["1", "2"]
    assert filled(first) == {"rating_a_slow", "rating_a_fast", "rating_b_slow", "rating_b_fast"}
    assert filled(second) == {"rating_a_slow", "rating_a_quick", "rating_b_slow", "rating_b_quick"}
    assert "| rating_a_fast | number |" in viewer.get("/studies/short/data/codebook.md").text
    [alone] = rows_of(viewer, "wide.csv?series=2")
    assert "rating_a_fast" not in alone


def test_a_factor_that_becomes_between_keeps_its_earlier_cells(
    viewer: Admin, study: StudyInDatabase, participant: Participant, tmp_path: Path
) -> None:
    participant.agree()
    participant.rate_all()
    assert SPEED in SHORT
    rate_in_next_version(study, participant, SHORT.replace(SPEED, f"{SPEED}between = true\n"), tmp_path)
    first, second = rows_of(viewer, "wide.csv")
    assert filled(first) == {"rating_a_slow", "rating_a_fast", "rating_b_slow", "rating_b_fast"}
    assert filled(second) == {"rating_a", "rating_b"}
    assert first["speed"] == ""
    assert second["speed"] in ("slow", "fast")


def test_cells_that_are_spelled_alike_have_the_names_of_the_codebook_in_every_extract(
    viewer: Admin, study: StudyInDatabase, participant: Participant, tmp_path: Path
) -> None:
    """Three versions with other factors and equal levels; nobody answered the second."""
    participant.agree()
    participant.rate_all()
    pace, tempo = (SHORT.replace('"speed"', f'"{name}"') for name in ("pace", "tempo"))
    changed, services = parse_experiment(pace), study.services
    with services.database.write() as session:
        stored = session.query(Study).one()
        add_version(session, stored, pace, changed, make_clip_folder(changed, tmp_path / "pace"), None)
    rate_in_next_version(study, participant, tempo.replace('label = "Speed"', 'label = "Tempo"'), tmp_path)
    codebook = viewer.get("/studies/short/data/codebook.md").text
    meanings = {
        name: next(line for line in codebook.splitlines() if f"| {name} |" in line)
        for name in (
            "rating_a_slow",
            "rating_a_slow_2",
            "rating_a_slow_3",
        )
    }
    assert "Tempo" in meanings["rating_a_slow"]
    first, second = rows_of(viewer, "wide.csv")
    assert {name for name in filled(first) if "a_slow" in name} == {"rating_a_slow_3"}
    assert {name for name in filled(second) if "a_slow" in name} == {"rating_a_slow"}
    [alone] = rows_of(viewer, "wide.csv?series=1")
    assert filled(alone) == filled(first)


def test_a_cell_of_two_scales_has_the_range_of_both() -> None:
    older, newer = (
        parse_experiment(SHORT.replace("[trial.scale]", f"[trial.scale]\nmaximum = {most}"))
        for most in (9, 5)
    )
    cells = cells_of(newer, [older])
    assert [cell.column.name for cell in cells] == [cell.column.name for cell in cells_of(newer)]
    assert {(cell.column.minimum, cell.column.maximum) for cell in cells} == {(1, 9)}


def test_the_cells_of_each_version_are_collected_once(monkeypatch: pytest.MonkeyPatch) -> None:
    newest = parse_experiment(SHORT)
    older, oldest = (parse_experiment(SHORT.replace('"speed"', f'"{name}"')) for name in ("pace", "tempo"))
    collected: list[Experiment] = []
    collect = tables._cells

    def noted(version: Experiment) -> list[Cell]:
        collected.append(version)
        return collect(version)

    monkeypatch.setattr(tables, "_cells", noted)
    cells = cells_of(newest, [oldest, newest], [newest, older, oldest])
    assert [cell.column.name for cell in cells] == [cell.column.name for cell in cells_of(newest)] + [
        f"rating_{character}_{speed}_3" for character in "ab" for speed in ("slow", "fast")
    ]
    assert [id(one) for one in collected[:3]] == [id(one) for one in (newest, oldest, older)]
    assert len(collected) == 4


def test_each_visit_has_its_own_means_and_one_is_in_memory_at_a_time(
    client: TestClient,
    services: Services,
    study: StudyInDatabase,
    viewer: Admin,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for rates in (True, False, True, True):
        person = Participant(client, study.link_token)
        person.start()
        person.agree()
        if rates:
            person.rate_all()
    taken: list[Any] = []

    def noted(*asked: Any) -> Iterator[Any]:
        for row in rating_rows(*asked):
            taken.append(row)
            yield row

    monkeypatch.setattr(tables, "rating_rows", noted)
    with services.database.read() as session:
        [known] = session.query(Study).all()
        rows = tables.wide_rows(session, known, EVERYTHING, study.experiment, [])
        at_once = [len(taken) for _ in rows]
    ratings = rows_of(viewer, "ratings.csv")
    assert len(taken) == len(ratings)
    assert at_once[0] < len(taken)
    visits = rows_of(viewer, "wide.csv")
    assert [row["answers"] for row in visits] == ["8", "0", "8", "8"]
    for row in visits:
        cell = (row["run"], "main", "a", "slow")
        given = [
            float(one["response"])
            for one in ratings
            if (one["run"], one["kind"], one["character"], one["speed"]) == cell
        ]
        assert row["rating_a_slow"] == (str(sum(given) / len(given)) if given else "")


def test_trials_without_a_scale_are_refused_before_the_download(
    viewer: Admin, services: Services, tmp_path: Any
) -> None:
    add_study(services, tmp_path / "clips", PAIRS)
    answer = viewer.get("/studies/short/data/wide.csv")
    assert answer.status_code == 422
    assert "use the long table" in answer.json()["error"]["message"]


def test_a_spreadsheet_gets_a_mark_and_nothing_it_could_run(
    viewer: Admin, services: Services, client: TestClient, tmp_path: Any
) -> None:
    text = SHORT.replace('type = "number"\nname = "age"', 'type = "text"\nname = "age"').replace(
        "minimum = 18\nmaximum = 120\n", ""
    )
    study = add_study(services, tmp_path / "clips", text)
    person = Participant(client, study.link_token).agree()
    evil = '=HYPERLINK("http://example.org";"a")'
    person.request("PUT", "/forms/about", {"answers": {"age": evil}})
    plain = viewer.get("/studies/short/data/runs.csv?guard=false").content
    usual = viewer.get("/studies/short/data/runs.csv").content
    safe = viewer.get("/studies/short/data/runs.csv?excel=true").content
    assert not plain.startswith(b"\xef\xbb\xbf")
    assert safe.startswith(b"\xef\xbb\xbf")
    [row] = csv.DictReader(io.StringIO(plain.decode()))
    [guarded] = csv.DictReader(io.StringIO(safe.decode("utf-8-sig")))
    assert row["form_about_age"] == evil
    assert safe == b"\xef\xbb\xbf" + usual
    assert guarded["form_about_age"] == f"'{evil}"


def test_columns_of_forms_never_share_a_name() -> None:
    text = SHORT.replace('name = "about"', 'name = "a"').replace('name = "age"', 'name = "b_c"')
    further = (
        '[[forms]]\nname = "a_b"\ntitle = { en = "More" }\n'
        '[[forms.fields]]\ntype = "text"\nname = "c"\nlabel = { en = "C" }\n'
    )
    columns = form_columns([parse_experiment(text.replace("[texts.en]", further + "\n[texts.en]"))])
    names = [one.column.name for one in columns]
    assert names == ["form_a_b_c", "form_a_glasses_glasses", "form_a_glasses_lenses", "form_a_b_c_2"]
    assert [one.column.identifying for one in columns] == [False, False, False, True]


def test_options_of_all_versions_are_in_the_codebook(viewer: Admin, study: StudyInDatabase) -> None:
    text = viewer.get("/studies/short/data/codebook.md").text
    assert "| form_about_age | integer |  | Age | 18 to 120 |" in text
    assert "What do you wear? Whether chosen: Lenses." in text
    assert "| character | text |  | Level of the factor Character. | a = A, b = B |" in text
    assert "| rating_a_slow | number |" in text


def test_a_last_play_without_an_answer_leaves_the_earlier_one_standing(
    viewer: Admin, participant: Participant
) -> None:
    participant.agree()
    trial = next(one for one in participant.state()["trials"] if one["kind"] == "main")
    not_shown = {"method": "none", "clip_sha256": None, "drawn": [], "frames_missing": None}
    assert participant.rate(trial, 6, playback={"focus_lost": 1}).status_code == 201
    assert participant.rate(trial, None, play=2, playback=not_shown).status_code == 201
    plays = [row for row in rows_of(viewer, "ratings.csv") if row["trial_index"] == str(trial["trial_index"])]
    assert [row["response"] for row in plays] == ["6", ""]
    [row] = rows_of(viewer, "wide.csv")
    assert row["answers"] == "1"
    assert [value for name, value in row.items() if name.startswith("rating_") and value] == ["6.0"]


def test_a_level_that_is_not_rated_has_no_column_and_is_none_in_scripts() -> None:
    text = (REPOSITORY / "experiments" / "dcr-demo.toml").read_text(encoding="utf-8")
    rated = parse_experiment(text)
    not_rated = parse_experiment(text.replace("rate_itself = true", "rate_itself = false"))
    assert [cell.levels for cell in cells_of(rated)] == [("both",), ("vertical",), ("none",)]
    assert [cell.levels for cell in cells_of(not_rated)] == [("vertical",), ("none",)]
    for language in LANGUAGES:
        assert '"both"' in script(rated, language, "ratings.csv")
        assert '"both"' not in script(not_rated, language, "ratings.csv")
