"""False evidence at full speed, with honest raters at the same time, on a server in a separate process."""

from pathlib import Path

from bench.false_answers import session


def test_false_answers_at_full_speed_are_all_refused_and_hinder_nobody(tmp_path: Path) -> None:
    counts = session(tmp_path, seconds=3, raters=2)
    assert counts.faults() == []
    assert counts.noted > 0
    assert len(counts.answers) == 10
