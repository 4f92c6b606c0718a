"""Tables that people already have: guesses, results equal to the command's, refusals in one line."""

import base64
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from openpyxl import Workbook
from scipy import stats
from typer.testing import CliRunner

from analysis.cli import app
from server.results import own_tables
from tests.helpers.admins import Admin

ROLES = {"id": "participant", "face": "within", "score": "rating", "note": ""}


def _rows() -> list[tuple[str, str, float, str]]:
    rng = np.random.default_rng(3)
    return [
        (f"p{n}", face, round(4 + shift + rng.normal(), 3), "x")
        for n in range(12)
        for face, shift in (("a", 0), ("b", 0.8))
    ]


def _csv() -> bytes:
    lines = [",".join(map(str, row)) for row in _rows()]
    return "\n".join(["id,face,score,note", *lines, ""]).encode()


def _body(content: bytes, name: str = "my ratings.csv", **more: Any) -> dict[str, Any]:
    return {"name": name, "content": base64.b64encode(content).decode(), **more}


def test_columns_are_guessed_and_nothing_stays(
    viewer: Admin, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    done = viewer.send("POST", "/analyses/columns", _body(_csv()))
    assert done.status_code == 200, done.text
    known = done.json()
    assert (known["n_rows"], known["command"]) == (24, "anova")
    assert {one["name"]: one["role"] for one in known["columns"]} == ROLES
    assert known["commands"]["anova"]["needed"] == ["participant", "rating"]
    assert not [*tmp_path.iterdir()]


def test_the_result_is_that_of_a_paired_t_test_and_of_the_command_shown(
    viewer: Admin, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done = viewer.send("POST", "/analyses", _body(_csv(), command="anova", roles=ROLES))
    assert done.status_code == 200, done.text
    shown = done.json()
    scores = np.array([row[2] for row in _rows()]).reshape(-1, 2)
    t = stats.ttest_rel(scores[:, 0], scores[:, 1])
    assert f"F(1, 11) = {t.statistic**2:.2f}" in shown["sentences"][0]
    assert not shown["synthetic"]
    means = next(table for table in shown["tables"] if table["title"].startswith("Marginal"))
    assert [float(row[1]) for row in means["rows"]] == pytest.approx(scores.mean(axis=0), abs=0.0006)
    [figure] = shown["figures"]
    assert base64.b64decode(figure["svg"]).lstrip().startswith(b"<?xml")
    assert base64.b64decode(figure["png"]).startswith(b"\x89PNG")
    # the command that the page shows gives the same test
    monkeypatch.chdir(tmp_path)
    Path("my ratings.csv").write_bytes(_csv())
    words = shown["command_line"].replace("'my ratings.csv'", "my_file").split()
    words[words.index("my_file")] = "my ratings.csv"
    ended = CliRunner().invoke(app, [*words[1:], "--json", "out.json"])
    assert ended.exit_code == 0, ended.output
    effect = json.loads(Path("out.json").read_text(encoding="utf-8"))["effects"][0]
    assert effect["univariate"]["f_value"] == pytest.approx(t.statistic**2, rel=1e-9)


def test_a_workbook_is_read(viewer: Admin, tmp_path: Path) -> None:
    book = Workbook()
    sheet = book.active
    assert sheet is not None
    for row in [("id", "face", "score", "note"), *_rows()]:
        sheet.append(row)
    book.save(tmp_path / "t.xlsx")
    done = viewer.send("POST", "/analyses/columns", _body((tmp_path / "t.xlsx").read_bytes(), "Ratings.XLSX"))
    assert done.status_code == 200, done.text
    assert done.json()["command"] == "anova"


@pytest.mark.parametrize(
    ("content", "name", "more", "said"),
    [
        (b"a,b\n1,2\n", "photo.png", {}, "'photo.png' is not a table; expected a file ending in .csv"),
        (b"a,b\n", "my table.csv", {}, "my table.csv has a header but no rows"),
        (b"\x00\x01\x02", "x.xlsx", {}, "x.xlsx"),
        (_csv(), "x.csv", {"command": "anova", "roles": {"id": "participant"}}, "needs a column for rating"),
        (_csv(), "x.csv", {"command": "run", "roles": ROLES}, "expected an analysis (anova"),
        (_csv(), "x.csv", {"command": "anova", "roles": {**ROLES, "face": ""}}, "needs a factor"),
        (
            _csv(),
            "x.csv",
            {"command": "anova", "roles": {**ROLES, "nose": "within"}},
            "x.csv has no column 'nose'",
        ),
        (
            _csv(),
            "x.csv",
            {"command": "anova", "roles": {**ROLES, "note": "participant"}},
            "takes one column for participant, got id, note",
        ),
    ],
)
def test_what_cannot_be_analyzed_is_one_line(
    viewer: Admin, content: bytes, name: str, more: dict[str, Any], said: str
) -> None:
    path = "/analyses" if more else "/analyses/columns"
    done = viewer.send("POST", path, _body(content, name, **more))
    assert done.status_code == 422, done.text
    message = done.json()["error"]["message"]
    assert said in message
    assert "\n" not in message
    assert "palpebra-table-" not in message


def test_column_names_are_never_options(viewer: Admin, tmp_path: Path) -> None:
    target = tmp_path / "written.json"
    evil = f"--json={target}"
    content = _csv().replace(b"face", evil.encode())
    roles = {"id": "participant", evil: "within", "score": "rating"}
    done = viewer.send("POST", "/analyses", _body(content, command="anova", roles=roles))
    assert done.status_code == 200, done.text
    assert not target.exists()


def test_a_long_analysis_ends_and_another_may_begin(viewer: Admin, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(own_tables, "LIMIT_S", 0.05)
    done = viewer.send("POST", "/analyses/columns", _body(_csv()))
    assert done.status_code == 422
    assert "did not end within" in done.json()["error"]["message"]
    monkeypatch.undo()
    assert viewer.send("POST", "/analyses/columns", _body(_csv())).status_code == 200


def test_who_is_not_signed_in_analyzes_nothing(viewer: Admin) -> None:
    viewer.client.cookies.clear()
    assert viewer.send("POST", "/analyses/columns", _body(_csv())).status_code == 401


def test_a_table_may_have_many_columns_and_any_name(viewer: Admin) -> None:
    lines = _csv().decode().splitlines()
    more = [f"c{k}" for k in range(150)]
    wide = "\n".join(
        [",".join([lines[0], *more]), *(",".join([one, *["7"] * 150]) for one in lines[1:])]
    ).encode()
    roles = {**ROLES, **dict.fromkeys(more, "")}
    done = viewer.send("POST", "/analyses", _body(wide, command="anova", roles=roles))
    assert done.status_code == 200, done.text
    rows = [dict(zip(("id", "face", "score", "note"), row, strict=True)) for row in _rows()]
    body = _body(json.dumps(rows).encode(), "roles.json", command="anova", roles=ROLES)
    done = viewer.send("POST", "/analyses", body)
    assert done.status_code == 200, done.text


def test_the_second_of_two_tables_at_once_is_refused_soon(viewer: Admin) -> None:
    with own_tables._one_at_a_time:
        done = viewer.send("POST", "/analyses/columns", _body(_csv()))
    assert done.status_code == 503
    assert done.headers["retry-after"] == "30"
