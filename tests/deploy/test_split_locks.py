"""Locks that never contradict each other, and are whole together."""

from pathlib import Path

import pytest

from tools.setup import ROOT, RUN_LOCK, TEST_LOCK
from tools.split_locks import entries, rest

ONE = "one==1.0 \\\n    --hash=sha256:aa\n"
TWO = "two==2.0 \\\n    --hash=sha256:bb \\\n    --hash=sha256:cc\n"
ELSEWHERE = "one==1.0 ; sys_platform == 'win32' \\\n    --hash=sha256:aa\n"


def test_what_the_base_has_is_left_out() -> None:
    assert rest(ONE + TWO, ONE) == TWO


def test_a_package_for_more_systems_than_the_base_has_it_for_stays() -> None:
    assert rest(ONE + TWO, ELSEWHERE) == ONE + TWO


def test_a_pin_that_contradicts_is_refused() -> None:
    with pytest.raises(ValueError, match=r"which lacks one==2\.0"):
        rest(ONE + TWO, ONE.replace("1.0", "2.0"))


def test_other_hashes_of_a_version_are_refused() -> None:
    with pytest.raises(ValueError, match=r"which lacks one==1\.0"):
        rest(ONE + TWO, ONE.replace("aa", "dd"))


def by_name(lock: Path) -> dict[str, str]:
    """The pin of each package."""
    return {entry.partition("==")[0]: entry for entry in entries(lock.read_text(encoding="utf-8"))}


def test_what_tests_add_contradicts_nothing_that_runs() -> None:
    runs, added = by_name(RUN_LOCK), by_name(TEST_LOCK)
    assert len(runs) > 80
    assert len(added) > 80
    for name in runs.keys() & added.keys():  # wanted on more systems by the tests
        assert runs[name].split()[0] == added[name].split()[0]
        assert " ; " in runs[name].splitlines()[0]
        assert " ; " not in added[name].splitlines()[0]


def test_what_a_server_adds_is_what_tests_have() -> None:
    added = by_name(ROOT / "deploy" / "s3.lock")
    assert "boto3" in added
    assert added.items() <= by_name(TEST_LOCK).items()
