"""Locks that hold no pin twice, and are whole together."""

import pytest

from tools.setup import RUN_LOCK, TEST_LOCK
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


def test_what_tests_add_repeats_nothing_that_runs() -> None:
    runs, added = (entries(lock.read_text(encoding="utf-8")) for lock in (RUN_LOCK, TEST_LOCK))
    assert len(runs) > 80
    assert len(added) > 80
    assert not set(runs) & set(added)
