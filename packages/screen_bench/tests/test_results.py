"""Results stored as they end: a run that was stopped goes on, piece by piece."""

import json
from dataclasses import asdict
from pathlib import Path

import pytest
from screen_bench import results as module
from screen_bench.measure import Row
from screen_bench.results import (
    HEADER,
    MAX_LOST_PIECES,
    PIECE_PLAYS,
    Results,
    cells,
    measure_in_pieces,
    row_of,
)

from packages.screen_bench.tests.test_compare import log, play, record

KEY = ("row", "chromium", "30", "idle")


def test_what_was_measured_with_as_many_plays_is_not_measured_again(tmp_path: Path) -> None:
    path = tmp_path / "out" / "scope.jsonl"
    Results(path).add(KEY, 20, ["chromium", "30"], {"plays": []})
    later = Results(path)
    assert later.has(KEY, 20)
    assert not later.has(KEY, 200)
    assert not later.has(("row", "firefox", "30", "idle"), 20)
    assert [result.cells for result in later.of("row")] == [("chromium", "30")]


def test_pieces_add_up_until_they_are_measured_anew(tmp_path: Path) -> None:
    path = tmp_path / "scope.jsonl"
    for count in (40, 40, 20):
        Results(path).add(KEY, count, [], None)
    assert Results(path).count(KEY) == 100
    anew = Results(path, again=True)
    assert anew.count(KEY) == 0
    anew.add(KEY, 40, [], None)
    anew.add(KEY, 20, [], None)
    assert anew.count(KEY) == Results(path).count(KEY) == 60


def test_plays_of_a_page_that_drew_otherwise_do_not_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "scope.jsonl"
    monkeypatch.setattr(module, "measured_sha256", lambda: "the page of before")
    Results(path).add(KEY, 40, [], None)
    monkeypatch.setattr(module, "measured_sha256", lambda: "this page")
    later = Results(path)
    assert later.count(KEY) == 0
    later.add(KEY, 20, [], None)
    assert [json.loads(line)["count"] for line in path.read_text().splitlines()] == [40, 20]


def test_two_pieces_make_the_row_that_both_would_have_been(tmp_path: Path) -> None:
    plays = (play(log(), record()), play(log(without=(7,)), record(verdict="uncertain")))
    whole = Row("chromium", "156", 30, "idle", plays, 0, 2000.0, True, (1.0, 3.0), 1.0, 0.0)
    path = tmp_path / "scope.jsonl"
    for one, load in zip(plays, whole.loads, strict=True):
        part = Row("chromium", "156", 30, "idle", (one,), 0, 2000.0, True, (load,), 1.0, 0.0)
        Results(path).add(KEY, 1, cells(part), asdict(part))
    joined = row_of([piece.details for piece in Results(path).pieces(KEY)])
    assert joined == whole
    assert cells(joined)[-1] == "1.0 to 3.0"
    assert len(cells(joined)) == len(HEADER)


def test_a_row_goes_on_with_the_piece_it_was_at_and_outlives_a_lost_one(tmp_path: Path) -> None:
    results, asked = Results(tmp_path / "scope.jsonl"), list[int]()
    results.add(KEY, PIECE_PLAYS, [], None)

    def piece(count: int) -> Row:
        asked.append(count)
        if len(asked) == 1:
            raise RuntimeError("the start key did not reach the page")
        return Row("chromium", "156", 30, "idle", (play(log(), record()),), 0, 2000.0, True, (1.0,), 1.0, 0.0)

    measure_in_pieces(results, KEY, 2 * PIECE_PLAYS + 10, piece)
    assert asked == [PIECE_PLAYS, PIECE_PLAYS, 10]
    assert results.has(KEY, 2 * PIECE_PLAYS + 10)

    def broken(count: int) -> Row:
        asked.append(count)
        raise RuntimeError("no window")

    asked.clear()
    with pytest.raises(RuntimeError, match="no window"):
        measure_in_pieces(results, KEY, 1000, broken)
    assert len(asked) == MAX_LOST_PIECES
