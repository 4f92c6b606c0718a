"""`--keep N` counts days, not files."""

from datetime import date, timedelta
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.core.settings import Settings
from server.operations.watched_backups import day_of, superfluous_backups
from tests.helpers.databases import run_server_command

DAYS = st.dates(date(2026, 1, 1), date(2026, 3, 1))
NAMES = st.builds(lambda day, hour: f"palpebra-{day}T{hour:02d}0000.tar", DAYS, st.integers(0, 23))


def names(*paths: Path) -> list[str]:
    return [path.name for path in paths]


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_two_backups_a_minute_apart_leave_the_one_of_twenty_days_ago(
    settings: Settings, tmp_path: Path
) -> None:
    old = tmp_path / "palpebra-2026-01-01T030000.tar"
    own = tmp_path / "palpebra-before-the-move.tar"
    for path in (old, own):
        path.touch()
    for minute in (0, 1):
        file = str(tmp_path / f"palpebra-2026-01-21T03{minute:02d}00.tar")
        called = run_server_command(settings, "backup", file, "--keep", "2")
        assert called.returncode == 0, called.stderr
    assert old.exists()
    assert own.exists()
    assert len(list(tmp_path.glob("*.tar"))) == 4
    again = run_server_command(settings, "backup", str(own))
    assert again.returncode == 2
    assert again.stderr.startswith(f"error: {own} already exists; choose another file")
    assert own.stat().st_size == 0
    assert run_server_command(settings, "backup", str(own), "--replace").returncode == 0
    assert own.stat().st_size > 0


def test_beyond_the_days_everything_goes_and_each_day_keeps_its_last() -> None:
    days = [date(2026, 1, 1) + timedelta(days=number) for number in range(4)]
    paths = [Path(f"palpebra-{day}T{hour}0000.tar") for day in days for hour in ("03", "15")]
    gone = superfluous_backups(paths, 3)
    assert names(*gone) == names(paths[0], paths[1], paths[2], paths[4])


@given(st.lists(NAMES, max_size=40, unique=True), st.integers(1, 20))
def test_the_promise_holds_for_any_set_of_backups(found: list[str], keep: int) -> None:
    paths = [Path(name) for name in found]
    left = set(paths) - set(superfluous_backups(paths, keep))
    days = sorted({day_of(path) for path in paths} - {None}, reverse=True)  # type: ignore[type-var]
    assert {day_of(path) for path in left} == set(days[:keep])
    assert superfluous_backups(left, keep) == []


@pytest.mark.parametrize("name", ["monday.tar", "palpebra-2026-13-01.tar", "palpebra-2026-01-01-x.tar"])
def test_a_file_that_somebody_named_stays(name: str) -> None:
    assert superfluous_backups([Path(name), Path("palpebra-2026-02-01.tar")], 1) == []
