"""The tests that compare moments on a screen go to one process, whatever the number of processes."""

import pytest

from tests.conftest import LONGEST_FILES, REPOSITORY, TIMED_FILES, FileScheduling, rank


def test_the_files_that_are_named_are_there() -> None:
    assert [path for path in (*TIMED_FILES, *LONGEST_FILES) if not (REPOSITORY / path).is_file()] == []


def test_browsers_come_after_the_others_longest_first_and_the_timed_last() -> None:
    short = "tests/browser/participant/test_evidence.py"
    order = ["tests/server/test_pages.py", *LONGEST_FILES, short, TIMED_FILES[0]]
    otherwise = list(reversed(order))
    assert sorted(otherwise, key=rank) == order


def test_the_timed_ones_are_one_scope_and_any_other_file_is_its_own(request: pytest.FixtureRequest) -> None:
    scope = FileScheduling._split_scope
    scheduling = object.__new__(FileScheduling)
    assert {scope(scheduling, f"{path}::test_a[{n}]") for path in TIMED_FILES for n in "12"} == {"timed"}
    assert scope(scheduling, request.node.nodeid) == "tests/deploy/test_order_of_tests.py"
