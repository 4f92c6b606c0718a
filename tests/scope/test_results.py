"""Results stored as they end: a run that was stopped goes on."""

from pathlib import Path

from tools.scope.results import Results

KEY = ("row", "chromium", "30", "idle")


def test_what_was_measured_with_as_many_plays_is_not_measured_again(tmp_path: Path) -> None:
    path = tmp_path / "out" / "scope.jsonl"
    Results(path).add(KEY, 20, ["chromium", "30"], {"plays": []})
    later = Results(path)
    assert later.has(KEY, 20)
    assert not later.has(KEY, 200)
    assert not later.has(("row", "firefox", "30", "idle"), 20)
    assert [result.cells for result in later.of("row")] == [("chromium", "30")]


def test_a_later_result_takes_the_place_of_an_earlier_one(tmp_path: Path) -> None:
    path = tmp_path / "scope.jsonl"
    for count in (20, 200):
        Results(path).add(KEY, count, [str(count)], None)
    assert [result.count for result in Results(path).of("row")] == [200]
    assert not Results(path, again=True).has(KEY, 20)
