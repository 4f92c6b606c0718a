"""Which backups stay: of each of the newest days its last one, and everything of the newest day."""

import re
from collections import defaultdict
from collections.abc import Iterable
from datetime import date
from pathlib import Path

_NAME = re.compile(r"palpebra-(\d{4}-\d{2}-\d{2})(T\d{6})?(-[0-9a-f]{16})?\.tar(\.age)?")


def day_of(path: Path) -> date | None:
    """The day (UTC) in the name of a backup; None where the name is one that nobody dated."""
    match = _NAME.fullmatch(path.name)
    try:
        return date.fromisoformat(match[1]) if match else None
    except ValueError:
        return None


def superfluous(paths: Iterable[Path], days: int) -> list[Path]:
    """Backups that `--keep DAYS` removes, the oldest first.

    A day counts where there is a backup of it, so that a machine that was off for a month keeps what it has.
    Files with other names stay: somebody named them for a reason.
    """
    by_day: dict[date, list[Path]] = defaultdict(list)
    for path in sorted(paths):
        if (day := day_of(path)) is not None:
            by_day[day].append(path)
    newest = sorted(by_day, reverse=True)
    earlier = {day: by_day[day] if age >= days else by_day[day][:-1] for age, day in enumerate(newest)}
    return [path for day in reversed(newest[1:]) for path in earlier[day]]
