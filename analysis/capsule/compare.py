"""Hold a report that was made again against the one in the capsule, file by file."""

import json
import math
import re
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any, Literal

from experiments.capsule.declaration import WRITTEN_BY_SERVER

Kind = Literal["same", "figure", "rounding", "table"]
RELATIVE = 1e-9
"""Numbers that differ by less than this share of themselves differ by rounding: other processors add up in
another order."""
_PICTURE = re.compile(r"data:image/[a-z+]+;base64,[A-Za-z0-9+/=]+")


@dataclass(frozen=True)
class Compared:
    """One file: `same` byte for byte, or what differs: a `figure`, `rounding` of numbers, or a `table`."""

    name: str
    kind: Kind
    said: str = ""


def compare_reports(names: tuple[str, ...], before: Path, after: Path) -> list[Compared]:
    """Every file of either report; `names` are those that the capsule promises.

    A file of the capsule's report that it does not promise, and that no server writes, is one that nobody can
    make again: it counts as a table that differs.
    """
    again = {path.name for path in after.iterdir()}
    held = {path.relative_to(before).as_posix() for path in before.rglob("*") if path.is_file()}
    more = sorted(held - {*names, *again, *WRITTEN_BY_SERVER})
    foreign = [
        Compared(name, "table", "in the capsule's report, and not made by the analysis") for name in more
    ]
    return [_of_name(name, names, again, before, after) for name in sorted({*names, *again})] + foreign


def _of_name(name: str, names: tuple[str, ...], again: set[str], before: Path, after: Path) -> Compared:
    if name not in again:
        return Compared(name, "table", "in the capsule, and not made now")
    if name not in names:
        return Compared(name, "table", "made now, and not in the capsule")
    return _compare(name, (before / name).read_bytes(), (after / name).read_bytes())


def _compare(name: str, before: bytes, after: bytes) -> Compared:
    if before == after:
        return Compared(name, "same")
    if name.endswith((".svg", ".png")):
        return Compared(name, "figure", f"{len(before):,} bytes became {len(after):,}")
    was, now = before.decode("utf-8", "replace"), after.decode("utf-8", "replace")
    if name.endswith(".json"):
        return _numbers(name, was, now)
    if name.endswith(".html") and _PICTURE.sub("", was) == _PICTURE.sub("", now):
        return Compared(name, "figure", "its pictures differ, its tables do not")
    return Compared(name, "table", _first_line(_PICTURE.sub("", was), _PICTURE.sub("", now)))


def _first_line(was: str, now: str) -> str:
    for number, (old, new) in enumerate(zip_longest(was.splitlines(), now.splitlines(), fillvalue=""), 1):
        if old != new:
            return f"line {number}: {_short(old)} became {_short(new)}"
    return "line ends differ"


def _short(text: str) -> str:
    text = text.strip()
    return repr(text if len(text) <= 70 else f"{text[:67]}...")


def _numbers(name: str, was: str, now: str) -> Compared:
    try:
        difference = _differs(json.loads(was), json.loads(now), "")
    except ValueError:
        return Compared(name, "table", "no JSON")
    if difference is None:
        return Compared(name, "rounding", f"numbers are equal to {RELATIVE:g}")
    return Compared(name, "table", difference)


def _differs(was: Any, now: Any, path: str) -> str | None:
    """The first place where two JSON values differ by more than rounding; None where there is none."""
    if isinstance(was, dict) and isinstance(now, dict):
        keys = list(dict.fromkeys((*was, *now)))
        differences = (_differs(was.get(key), now.get(key), f"{path}.{key}".lstrip(".")) for key in keys)
        return next((difference for difference in differences if difference), None)
    if isinstance(was, list) and isinstance(now, list) and len(was) == len(now):
        pairs = enumerate(zip(was, now, strict=True))
        differences = (_differs(old, new, f"{path}[{number}]") for number, (old, new) in pairs)
        return next((difference for difference in differences if difference), None)
    if _are_numbers(was, now) and math.isclose(was, now, rel_tol=RELATIVE, abs_tol=1e-12):
        return None
    return None if was == now else f"{path}: {_short(str(was))} became {_short(str(now))}"


def _are_numbers(*values: Any) -> bool:
    return all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)
