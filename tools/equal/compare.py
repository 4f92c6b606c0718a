"""Compare two folders of normalized outputs: what differs, and which differences are declared."""

from __future__ import annotations

import csv
import difflib
import fnmatch
import io
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

DECLARED = Path(__file__).with_name("declared_differences.toml")
SHOWN_CHARACTERS = 160


@dataclass(frozen=True)
class Declared:
    """A difference that is meant.

    Attributes
    ----------
    path : str
        Pattern of the files, from the part on: `exports/*/wide.csv`.
    reason : str
        Why they differ.
    allow : str
        `any`: the files may differ, or one may be missing. `column order`: the same cells under the same
        column names, in another order.
    """

    path: str
    reason: str
    allow: str = "any"


@dataclass(frozen=True)
class Difference:
    """Two files that are not equal, and the first line where they part."""

    path: str
    detail: str
    reason: str = ""


class NothingToCompareError(Exception):
    """One side has no files, or an empty one: a comparison would prove nothing."""


def declared_differences(file: Path = DECLARED) -> list[Declared]:
    """What is declared in a file; ValueError where an entry has no path or no reason."""
    entries = tomllib.loads(file.read_text(encoding="utf-8")).get("difference", [])
    for entry in entries:
        if not entry.get("path") or not entry.get("reason") or set(entry) - {"path", "reason", "allow"}:
            raise ValueError(f"{file.name}: expected path, reason and perhaps allow, got {entry}")
        if entry.get("allow", "any") not in ("any", "column order"):
            raise ValueError(f"{file.name}: allow is 'any' or 'column order', got {entry['allow']!r}")
    return [Declared(**entry) for entry in entries]


def files_below(folder: Path) -> dict[str, Path]:
    """Files of a folder by their path in it; NothingToCompareError where there are none, or empty ones."""
    files = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if path.is_file()}
    if not files:
        raise NothingToCompareError(f"no output in {folder}")
    empty = [name for name, path in files.items() if not path.stat().st_size]
    if empty:
        raise NothingToCompareError(f"empty output in {folder}: {', '.join(sorted(empty)[:5])}")
    return files


def compare_folders(
    part: str, base: Path, head: Path, declared: Sequence[Declared]
) -> tuple[int, list[Difference]]:
    """How many files a part has, and those that differ; declared ones have their reason."""
    before, after = files_below(base), files_below(head)
    names = sorted({*before, *after})
    differences = []
    for name in names:
        path = f"{part}/{name}"
        if name not in before or name not in after:
            detail = f"only in {'head' if name in after else 'base'}"
            rule = matching(path, declared, b"", b"")
        else:
            old, new = before[name].read_bytes(), after[name].read_bytes()
            if old == new:
                continue
            detail, rule = first_difference(old, new), matching(path, declared, old, new)
        differences.append(Difference(path, detail, rule.reason if rule else ""))
    return len(names), differences


def matching(path: str, declared: Iterable[Declared], old: bytes, new: bytes) -> Declared | None:
    """The declaration that allows two files to differ, if there is one."""
    for rule in declared:
        if fnmatch.fnmatch(path, rule.path) and (rule.allow == "any" or same_cells(old, new)):
            return rule
    return None


def same_cells(old: bytes, new: bytes) -> bool:
    """Whether two CSV files have the same rows under the same column names, whatever the columns' order."""
    tables = []
    for content in (old, new):
        rows = list(csv.reader(io.StringIO(content.decode("utf-8-sig"), newline="")))
        if not rows:
            return False
        order = sorted(range(len(rows[0])), key=rows[0].__getitem__)
        tables.append([[row[at] for at in order] for row in rows])
    return tables[0] == tables[1]


def first_difference(old: bytes, new: bytes) -> str:
    """The first line that differs, on both sides; of binary files their lengths and the first byte."""
    if b"\0" in old[:4096] or b"\0" in new[:4096]:
        at = next(
            (i for i, (a, b) in enumerate(zip(old, new, strict=False)) if a != b), min(len(old), len(new))
        )
        return f"{len(old):,} and {len(new):,} bytes, the first that differs is {at:,}"
    lines = [content.decode("utf-8", errors="replace").splitlines() for content in (old, new)]
    count = len(list(changed_lines(lines[0], lines[1])))
    for number, (a, b) in enumerate(zip(*lines, strict=False), 1):
        if a != b:
            lines_differ = f" ({count} lines differ)" if count else ""
            return f"line {number}{lines_differ}\n    - {excerpt(a, b)}\n    + {excerpt(b, a)}"
    shorter = min(len(lines[0]), len(lines[1]))
    if len(lines[0]) == len(lines[1]):
        return "line endings differ"
    return f"{len(lines[0])} and {len(lines[1])} lines, equal up to line {shorter}"


def changed_lines(old: list[str], new: list[str], limit: int = 4000) -> Iterator[str]:
    """Lines that differ; of long files only the first lines are looked at, as matching is slow."""
    for line in difflib.unified_diff(old[:limit], new[:limit], lineterm="", n=0):
        if not line.startswith(("+++", "---", "@@")):
            yield line


def excerpt(line: str, other: str) -> str:
    """A line from a little before the character where it differs from another."""
    at = next((i for i, (a, b) in enumerate(zip(line, other, strict=False)) if a != b), 0)
    begin = max(0, at - SHOWN_CHARACTERS // 4)
    cut = line[begin : begin + SHOWN_CHARACTERS]
    return ("..." if begin else "") + cut + ("..." if begin + SHOWN_CHARACTERS < len(line) else "")
