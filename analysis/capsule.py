"""Rebuild a capsule's report, and compare it with the one in the capsule, file by file."""

import json
import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import date
from itertools import zip_longest
from pathlib import Path
from typing import Any, Literal

from analysis.plans.plan import plan_of, study_contents
from analysis.read.pool import Origin, Pool
from analysis.read.study_answers import load_csv, read_runs
from analysis.report.contents import Progress, held_against
from analysis.report.write import write_report
from experiments.capsule import MANIFEST, WRITTEN_BY_SERVER, ReportSource, report_input
from experiments.load import load_experiment
from experiments.seal import read_clips_sha256, read_seal

# Make the report of a capsule again, from its declaration and its table of answers alone.

ANSWERS = "answers.csv"
"""Name of the table during the analysis; the report shows it."""


def rebuild(source: ReportSource, folder: Path, work: Path, progress: Progress = lambda _: None) -> Path:
    """Write the report into `work`, an empty folder; return the folder of the report.

    Parameters
    ----------
    folder : Path
        Of the capsule's files, checked.
    """
    table, report = work / ANSWERS, work / "report"
    report_input(folder / source.answers, table, source.renamed)
    experiment = load_experiment(str(folder / source.definition), has_data=True)
    progress("reading answers")
    runs = read_runs(folder / source.runs)
    answers = load_csv(table, experiment, plan_of(experiment.trial.kind).reading)
    contents = study_contents(experiment, answers, Pool(Origin(source.origin), source.series), runs)
    if source.seal is not None:
        clips = read_clips_sha256(folder / MANIFEST)
        contents = held_against(contents, read_seal(folder / source.seal), experiment, clips)
    write_report(contents, report, more=source.sensitivity, progress=progress)
    return report


# Changes that were made on purpose in reports: `analysis verify` lists them for an older capsule.
#
# A changed number has its line under "Numbers changed" in CHANGELOG.md: the command, the wrong number, how to
# notice it. A change of wording leaves every number as it was.

CHANGED = date(2026, 11, 28)
"""The day of the changes of 0.2.0's last week."""
REWORDED = date(2026, 11, 30)
"""The last day on which sentences, captions and notes were rewritten in plain English."""


@dataclass(frozen=True)
class IntendedChange:
    """A part of a report that a release changed.

    Attributes
    ----------
    since : date
        The day of the change: later capsules have the new numbers.
    part : str
        Regular expression of places in `results.json`, such as `pairwise[3].cell_a`, and of headings in
        `report.md`.
    why : str
        What is different now, without a full stop.
    wording : bool
        Whether the change explains sentences whose numbers are equal, and nothing else.
    """

    since: date
    part: str
    why: str
    wording: bool = False


INTENDED = (
    IntendedChange(CHANGED, r"pairwise\[\d+\]\.cell_[ab]\b.*", "pairs name their cells as levels by factor"),
    IntendedChange(
        CHANGED,
        "Ordinal mixed model",
        "the ordinal model has slopes of every effect, interactions included, and accurate integrals; the p "
        "next to it is that of the F reported first",
    ),
    IntendedChange(
        CHANGED,
        "Linear mixed model",
        "covariates that vary within participants have slopes by participant; the p next to the model is "
        "that of the F reported first",
    ),
    IntendedChange(
        CHANGED,
        r"Multiverse of exclusions|In brief|In sentences|Method|simple_effects\b.*",
        "the F that is reported first is the same in every part of a report",
    ),
    IntendedChange(
        CHANGED,
        r"Evidence that responses are from a person|evidence\b.*",
        "the verdict 'likely' needs checks that were passed",
    ),
    IntendedChange(
        CHANGED,
        r"Exclusions and decisions|decisions\b.*",
        "copied rows and repeated ids are named as decisions",
    ),
    IntendedChange(
        REWORDED,
        r"Exclusions and decisions|exclusions\.set_aside\b.*|decisions\b.*",
        "rows of other origins are counted among those set aside",
    ),
    IntendedChange(REWORDED, "Bayes factors", "every pair of levels has a Bayes factor, planned or not"),
    IntendedChange(
        REWORDED,
        "Linear mixed model|Ordinal mixed model",
        "formulas are written as --formula reads them, and notes say what slopes are",
    ),
    IntendedChange(
        REWORDED,
        "In brief|In sentences|Robust companions",
        "halves are rounded away from zero, thresholds have intervals in sentences, and effects are named "
        "on which the mixed model and the ANOVA disagree",
    ),
    IntendedChange(REWORDED, "Method", "methods that were not used are not described"),
    IntendedChange(REWORDED, r".*", "the wording is in plainer English; all numbers are equal", wording=True),
)
RENAMED = {
    "Who and what was left out": "Exclusions and decisions",
    "Evidence that answers are a person's": "Evidence that responses are from a person",
    "Ratings behind blinks": "Lag of ratings after blinks",
    "Yes or right": "Yes or correct",
    "Ratings by condition": "Mean ratings by condition, with tests of each factor",
    "(turned)": "(reversed)",
}
"""Headings, titles and short cells of older reports, and what they are called now."""


def intended_change(spot: str, made: date, reworded: bool = False) -> IntendedChange | None:
    """The change that explains a difference at this spot in a capsule made on this day; None elsewhere.

    Parameters
    ----------
    spot : str
        Place in `results.json`, or heading in `report.md`.
    made : date
        The day on which the capsule was made.
    reworded : bool
        Whether only the words of sentences differ there: `is_reworded`.
    """
    return next(
        (
            one
            for one in INTENDED
            if made <= one.since and one.wording is reworded and re.fullmatch(one.part, spot)
        ),
        None,
    )


def is_reworded(was: str, now: str) -> bool:
    """Whether two texts differ only in sentences and renamed terms: equal numbers, equal rows of tables."""
    for old, new in RENAMED.items():
        was = was.replace(old, new)
    return _fixed_parts(was) == _fixed_parts(now)


def _fixed_parts(text: str) -> list[str]:
    """Numbers of the sentences and rows of the tables of a text; names and other short cells whole."""
    fixed: list[str] = []
    for line in text.splitlines():
        sentence = len(line.split()) >= SENTENCE_WORDS and not line.startswith("|")
        fixed += _NUMBER.findall(line) if sentence else [line.strip()]
    return [one for one in fixed if one]


# Hold a report that was made again against the one in the capsule, file by file.

Kind = Literal["same", "figure", "rounding", "table"]
RELATIVE = 1e-9
"""Numbers that differ by less than this share of themselves differ by rounding: other processors add up in
another order."""
SENTENCE_WORDS = 4
"""A line with fewer words is a name or a cell of a table, whose change no new wording explains."""
_NUMBER = re.compile(r"\d[\d.,]*\d|\d")
_PICTURE = re.compile(r"data:image/[a-z+]+;base64,[A-Za-z0-9+/=]+")


@dataclass(frozen=True)
class FileComparison:
    """One file: `same` byte for byte, or what differs: a `figure`, `rounding` of numbers, or a `table`."""

    name: str
    kind: Kind
    said: str = ""


def compare_reports(names: tuple[str, ...], before: Path, after: Path, made: date) -> list[FileComparison]:
    """Every file of either report; `names` are those that the capsule of the day `made` promises.

    A file of the capsule's report that it does not promise, and that no server writes, is one that nobody can
    make again: it counts as a table that differs.
    """
    again = {path.name for path in after.iterdir()}
    held = {path.relative_to(before).as_posix() for path in before.rglob("*") if path.is_file()}
    more = sorted(held - {*names, *again, *WRITTEN_BY_SERVER})
    foreign = [
        FileComparison(name, "table", "in the capsule's report, and not made by the analysis")
        for name in more
    ]
    return [
        _of_name(name, names, again, (before, after), made) for name in sorted({*names, *again})
    ] + foreign


def _of_name(
    name: str, names: tuple[str, ...], again: set[str], folders: tuple[Path, Path], made: date
) -> FileComparison:
    if name not in again:
        return FileComparison(name, "table", "in the capsule, and not made now")
    if name not in names:
        return FileComparison(name, "table", "made now, and not in the capsule")
    before, after = folders
    return _compare(name, (before / name).read_bytes(), (after / name).read_bytes(), made)


def _compare(name: str, before: bytes, after: bytes, made: date) -> FileComparison:
    if before == after:
        return FileComparison(name, "same")
    if name.endswith((".svg", ".png")):
        return FileComparison(name, "figure", f"{len(before):,} bytes became {len(after):,}")
    was, now = before.decode("utf-8", "replace"), after.decode("utf-8", "replace")
    if name.endswith(".json"):
        return _numbers(name, was, now, made)
    if name.endswith(".html") and _PICTURE.sub("", was) == _PICTURE.sub("", now):
        return FileComparison(name, "figure", "its pictures differ, its tables do not")
    if name.endswith(".md"):
        return FileComparison(name, "table", _explained(_sections_that_differ(was, now), made))
    return FileComparison(name, "table", _first_line(_PICTURE.sub("", was), _PICTURE.sub("", now)))


@dataclass(frozen=True)
class Difference:
    """A place where two reports differ: which, how in words, and whether only wording differs."""

    spot: str
    said: str
    reworded: bool


def _sections_that_differ(was: str, now: str) -> Iterator[Difference]:
    """The headings below which two reports differ, each with its first line that does."""
    before, after = _sections(was), _sections(now)
    for heading in dict.fromkeys((*before, *after)):
        old, new = before.get(heading, ""), after.get(heading, "")
        if old != new:
            yield Difference(heading, f"'{heading}', {_first_line(old, new)}", is_reworded(old, new))


def _sections(report: str) -> dict[str, str]:
    """The text below each heading, by the heading's name of today."""
    parts = re.split(r"^#+ (.*)$", report, flags=re.MULTILINE)
    headings = (RENAMED.get(heading, heading) for heading in parts[1::2])
    return {"": parts[0], **dict(zip(headings, parts[2::2], strict=True))}


def _first_line(was: str, now: str) -> str:
    for number, (old, new) in enumerate(zip_longest(was.splitlines(), now.splitlines(), fillvalue=""), 1):
        if old != new:
            return f"line {number}: {_short(old)} became {_short(new)}"
    return "line ends differ"


def _short(text: str) -> str:
    text = text.strip()
    return repr(text if len(text) <= 70 else f"{text[:67]}...")


def _numbers(name: str, was: str, now: str, made: date) -> FileComparison:
    try:
        spots = list(_differences(json.loads(was), json.loads(now), ""))
    except ValueError:
        return FileComparison(name, "table", "no JSON")
    if not spots:
        return FileComparison(name, "rounding", f"numbers are equal to {RELATIVE:g}")
    return FileComparison(name, "table", _explained(spots, made))


def _explained(differences: Iterable[Difference], made: date) -> str:
    """What differs, in words: what nothing explains first, then what changed on purpose with its reason."""
    by_change: dict[IntendedChange | None, list[str]] = {}
    for one in differences:
        by_change.setdefault(intended_change(one.spot, made, one.reworded), []).append(one.said)
    unexplained = by_change.pop(None, [])
    numbers = [_reason(change, said) for change, said in by_change.items() if change and not change.wording]
    words = [_reason(change, said) for change, said in by_change.items() if change and change.wording]
    if numbers:
        numbers[-1] += " (CHANGELOG.md, Numbers changed)"
    rest = [f"{unexplained[0]}{_more(unexplained)}"] if unexplained else []
    return "; ".join((*rest, *numbers, *words))


def _reason(change: IntendedChange, said: list[str]) -> str:
    return f"{said[0]}{_more(said)}, changed on purpose on {change.since}: {change.why}"


def _more(said: list[str]) -> str:
    return f" and {len(said) - 1} more" if len(said) > 1 else ""


def _differences(was: Any, now: Any, spot: str) -> Iterator[Difference]:
    """Every spot where two JSON values differ by more than rounding, and how."""
    if isinstance(was, dict) and isinstance(now, dict):
        for key in dict.fromkeys((*was, *now)):
            yield from _differences(was.get(key), now.get(key), f"{spot}.{key}".lstrip("."))
    elif isinstance(was, list) and isinstance(now, list) and len(was) == len(now):
        for number, (old, new) in enumerate(zip(was, now, strict=True)):
            yield from _differences(old, new, f"{spot}[{number}]")
    elif _are_numbers(was, now) and math.isclose(was, now, rel_tol=RELATIVE, abs_tol=1e-12):
        return
    elif was != now:
        words = isinstance(was, str) and isinstance(now, str)
        said = f"{spot}: {_short(str(was))} became {_short(str(now))}"
        yield Difference(spot, said, words and is_reworded(was, now))


def _are_numbers(*values: Any) -> bool:
    return all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)
