"""`make check` keeps names that say nothing out of the code."""

import pytest

from tools.check_names import faults


@pytest.mark.parametrize(
    ("path", "text", "said"),
    [
        ("server/a.py", "found = 1", "server/a.py:1: 'found' does not say what it holds"),
        ("server/a.py", "def f(\n    _who: int) -> None: ...", "server/a.py:2: '_who' does not say"),
        ("server/a.py", "MOST_ROWS = 3", "server/a.py:1: 'MOST_ROWS': write max, not most"),
        ("server/a.py", "film_names = []", "server/a.py:1: 'film_names': write clip, not film"),
        ("server/a.py", "class Wanted: ...", "server/a.py:1: 'Wanted' does not say what it holds"),
        ("server/a.py", "class ClipPlace: ...", "server/a.py:1: 'ClipPlace' does not say what it holds"),
        ("server/a.py", "def rows_found(): ...", "server/a.py:1: 'rows_found' does not say what it holds"),
        ("server/a.py", "FIRST_PLACE = 1", "server/a.py:1: 'FIRST_PLACE' does not say what it holds"),
        ("server/a.py", "self.wanted = [place for place in range(3)]", "'place' does not say what it holds"),
    ],
)
def test_a_name_that_says_nothing_is_refused(path: str, text: str, said: str) -> None:
    assert said in "\n".join(faults(path, text))


def test_other_names_and_films_of_screens_pass() -> None:
    assert faults("server/a.py", "class NotFound: ...\nplacement = replace = whose = unwanted_rows = 1") == []
    assert faults("server/a.py", "position = most_recent = who_rated = 1\nprint(found)") == []
    assert faults("stimuli_builder/sync_patch/film.py", "film = 1") == []
