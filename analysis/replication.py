"""Published studies rebuilt from their raw files: every printed number next to ours."""

import ast
import contextlib
import gzip
import hashlib
import io
import json
import operator
import re
import tempfile
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Annotated, Any, Literal

import pandas as pd
import typer
from pydantic import Field, ValidationError, ValidationInfo, field_validator

from analysis.report.formats import Table
from analysis.report.numbers import DASH
from experiments.declaration.base import Declaration
from experiments.errors import InputError

SHIPPED = Path(__file__).parent / "published"
# A study may come from a stranger: its commands read the table they are given, and write no other file.
TABLE_COMMANDS = (
    *("anova", "ranks", "t-test", "mixed", "ordinal"),
    *("pairs", "thresholds", "opinion", "reliability", "agreement"),
)
TABLE_MAKERS = ("synthesise",)
FILE_OPTIONS = ("--json", "--out", "--scores", "--factors", "--residuals")
DECLARATION = "study.toml"
CommandLine = Callable[[list[str]], object]
"""Runs a command line, and raises its errors."""
WRONG_CALLS: tuple[Any, ...] = typer.BadParameter.__bases__
"""Errors of a command line, such as an unknown option; typer gives the class no public name."""

# What a study's folder declares.


class Replacement(Declaration):
    """A value for the cells of some columns in the rows of a condition, where `{column}` is each column."""

    columns: tuple[str, ...]
    when: str
    by: str


class Figure(Declaration):
    """One printed number and where it is in the JSON of the analysis."""

    name: str
    printed: str
    at: str


class PrintedColumn(Declaration):
    """A column of printed numbers: its address for each row, and how exact the numbers are.

    `within` is the largest difference that counts as equal, in units of the address `of` if there is one.
    """

    at: str
    decimals: int | None = None
    within: float | None = None
    of: str | None = None


class PrintedFile(Declaration):
    """A file of printed numbers (CSV, or JSON), one row per item."""

    file: str
    where: str | None = None
    label: tuple[str, ...] = ()
    columns: dict[str, PrintedColumn]


class StudyAnalysis(Declaration):
    """One command of `analysis` on one raw file, and the numbers printed of it.

    Attributes
    ----------
    table : str
        Raw file; or `made_by`, a command that makes it.
    read : {"table", "matrix"}
        A matrix has one row per item and one column per person; blocks are repetitions.
    where : str, optional
        Condition on the columns: only these rows.
    join, columns : dict
        New columns: texts joined from others, and arithmetic on others.
    run : tuple of str
        Command and its options; the file comes after the command.
    form, printed : str
        A sentence with addresses in braces, and the same as printed. `{tests[0].t:2}` has two decimals where
        the print leaves out zeros at the end.
    cases : tuple of dict
        The analysis is repeated for each, with its values in place of `{name}` in every text.
    """

    name: str
    table: str | None = None
    made_by: tuple[str, ...] = ()
    read: Literal["table", "matrix"] = "table"
    where: str | None = None
    replace: tuple[Replacement, ...] = ()
    join: dict[str, str] = Field(default_factory=dict)
    columns: dict[str, str] = Field(default_factory=dict)
    run: Annotated[tuple[str, ...], Field(min_length=1)]
    form: str | None = None
    printed: str | None = None
    figures: tuple[Figure, ...] = ()
    file: tuple[PrintedFile, ...] = ()
    cases: tuple[dict[str, str | int], ...] = ()
    slow: bool = False

    @field_validator("run", "made_by")
    @classmethod
    def _reads_one_table(cls, words: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        allowed = TABLE_COMMANDS if info.field_name == "run" else TABLE_MAKERS
        if words and words[0] not in allowed:
            raise ValueError(f"expected one of {', '.join(allowed)}, got '{words[0]}'")
        for word in words:
            if word.split("=")[0] in FILE_OPTIONS:
                raise ValueError(
                    f"a study may not choose files: expected no {', '.join(FILE_OPTIONS)}, got '{word}'"
                )
        return words


class NotReproduced(Declaration):
    """Printed numbers that are not reproduced, by a pattern of their names, and why."""

    figure: str
    reason: str


class Study(Declaration):
    """A published study: where it is from, its files with their SHA-256, its analyses."""

    title: str
    source: str
    license: str
    synthetic: bool = False
    note: str = ""
    files: dict[str, Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]] = Field(default_factory=dict)
    analysis: Annotated[tuple[StudyAnalysis, ...], Field(min_length=1)]
    not_reproduced: tuple[NotReproduced, ...] = ()


# What comes of it.


@dataclass(frozen=True)
class Comparison:
    """A printed number, ours, and whether they are equal to the last printed digit or the tolerance."""

    analysis: str
    figure: str
    printed: str
    ours: float
    equal: bool
    reason: str = ""


@dataclass(frozen=True)
class Replication:
    """A study's comparisons; `missing` is what the user must add where files are not shipped."""

    name: str
    study: Study
    rows: tuple[Comparison, ...]
    missing: str = ""
    left_out: int = 0

    @property
    def n_equal(self) -> int:
        """Numbers that are equal."""
        return sum(row.equal for row in self.rows)

    def summary(self) -> dict[str, Any]:
        """The study in numbers."""
        about = self.study.model_dump(include={"title", "source", "license", "synthetic", "note"})
        counts = {"printed": len(self.rows), "equal": self.n_equal, "missing": self.missing}
        reasons = [one.model_dump() for one in self.study.not_reproduced]
        return {"name": self.name, **about, **counts, "not_reproduced": reasons}

    @property
    def unexplained(self) -> tuple[Comparison, ...]:
        """Numbers that differ without a declared reason, or are equal where a difference was declared."""
        return tuple(row for row in self.rows if row.equal == bool(row.reason))


def shipped_studies() -> list[str]:
    """Names of the studies in the order of the table: those of the paper first."""
    names = sorted(path.parent.name for path in SHIPPED.glob(f"*/{DECLARATION}"))
    return sorted(names, key=lambda name: not name.startswith("paper-"))


def load_study(name: str) -> tuple[Path, Study]:
    """A shipped study, or one of a folder with `study.toml`.

    Raises
    ------
    InputError
        An unknown name, or the first thing that is wrong in the declaration.
    """
    folder = SHIPPED / name if name in shipped_studies() else Path(name)
    file = folder / DECLARATION
    if not file.is_file():
        raise InputError(
            f"there is no study '{name}', and no folder with a {DECLARATION} of that name; shipped are "
            f"{', '.join(shipped_studies())}"
        )
    try:
        return folder, Study.model_validate(tomllib.loads(file.read_text(encoding="utf-8")))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{file} is not valid TOML: {error}") from error
    except ValidationError as error:
        detail = error.errors()[0]
        where = ".".join(str(part + 1) if isinstance(part, int) else part for part in detail["loc"])
        raise InputError(f"{file}: {where}: {detail['msg']}") from error


def replicate_study(run: CommandLine, name: str, data: Path | None = None, slow: bool = False) -> Replication:
    """Rebuild every printed number of a study.

    Parameters
    ----------
    run : callable
        Runs a command of `analysis`, given its name and arguments.
    name : str
        A shipped study, or a folder.
    data : Path, optional
        Folder with the user's copy of files that are not shipped.
    slow : bool
        Whether to run analyses marked as slow, such as bootstraps.

    Raises
    ------
    InputError
        A file with another content than declared, an address without a number, or as the analyses do.
    """
    folder, study = load_study(name)
    files = {file: _find_file(file, folder, data) for file in study.files}
    if lacking := [file for file, path in files.items() if path is None]:
        said = (
            f"not shipped ({study.license}): {', '.join(lacking)}; get them from {study.source}, then --data"
        )
        return Replication(folder.name, study, (), said)
    contents = {file: _verified(file, path, study.files[file]) for file, path in files.items() if path}
    chosen = [one for one in study.analysis if slow or not one.slow]
    rows = [row for one in chosen for case in _cases(one) for row in _compared(run, case, contents)]
    named = {one.figure: one.reason for one in study.not_reproduced}
    explained = tuple(_explained(row, named) for row in rows)
    return Replication(folder.name, study, explained, left_out=len(study.analysis) - len(chosen))


def _explained(row: Comparison, reasons: Mapping[str, str]) -> Comparison:
    name = f"{row.analysis}: {row.figure}"
    reason = next((why for pattern, why in reasons.items() if re.search(pattern, name)), "")
    return Comparison(row.analysis, row.figure, row.printed, row.ours, row.equal, reason)


def _find_file(file: str, folder: Path, data: Path | None) -> Path | None:
    places = [path for base in (data, folder) if base for path in (base / file, base / f"{file}.gz")]
    return next((path for path in places if path.is_file()), None)


def _verified(file: str, path: Path, sha256: str) -> bytes:
    content = gzip.decompress(path.read_bytes()) if path.suffix == ".gz" else path.read_bytes()
    digest = hashlib.sha256(content).hexdigest()
    if digest != sha256:
        raise InputError(
            f"{path}: SHA-256 is {digest[:12]}..., expected {sha256[:12]}... of the published {file}; get "
            "the file again from the source in study.toml"
        )
    return content


def _cases(analysis: StudyAnalysis) -> Iterator[StudyAnalysis]:
    """The analysis once, or once for each of its cases with the values put in."""
    if not analysis.cases:
        yield analysis
    for case in analysis.cases:
        text = analysis.model_copy(update={"cases": ()}).model_dump_json(exclude_none=True)
        for key, value in case.items():
            text = text.replace(f"{{{key}}}", json.dumps(str(value))[1:-1])
        filled = json.loads(text)
        yield StudyAnalysis.model_validate({**filled, **{k: v for k, v in case.items() if k == "printed"}})


def _compared(
    run: CommandLine, analysis: StudyAnalysis, contents: Mapping[str, bytes]
) -> Iterator[Comparison]:
    """Run the command on the table, and put each printed number next to ours."""
    with tempfile.TemporaryDirectory() as scratch:
        table, out = Path(scratch) / Path(analysis.table or "made.csv").name, Path(scratch) / "out.json"
        if analysis.made_by:
            _run_command(run, analysis, [*analysis.made_by, "--out", str(table)])
        elif analysis.table:
            _table(analysis, contents).to_csv(table, index=False)
        command, *options = analysis.run
        _run_command(run, analysis, [command, str(table), *options, "--json", str(out)])
        numbers = json.loads(out.read_text(encoding="utf-8"))
    for figure in (*_sentence(analysis), *analysis.figures):
        at, _, decimals = figure.at.rpartition(":") if re.search(r":\d$", figure.at) else (figure.at, "", "")
        column = PrintedColumn(at=at, decimals=int(decimals) if decimals else None)
        yield _comparison(analysis.name, figure.name, figure.printed, numbers, column)
    for file in analysis.file:
        for label, name, row in _printed_numbers(file, contents):
            column = file.columns[name]
            addresses = {k: _filled(v, row) for k, v in (("at", column.at), ("of", column.of)) if v}
            own = column.model_copy(update=addresses)
            yield _comparison(analysis.name, label, str(row[name]), numbers, own)


def _run_command(run: CommandLine, analysis: StudyAnalysis, arguments: Sequence[str]) -> None:
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            run(list(arguments))
    except (InputError, *WRONG_CALLS) as error:
        raise InputError(f"{analysis.name}: {error}") from error


def _table(analysis: StudyAnalysis, contents: Mapping[str, bytes]) -> pd.DataFrame:
    """The raw file as the table that a command reads."""
    if analysis.table is None or analysis.table not in contents:
        raise InputError(f"{analysis.name}: '{analysis.table}' is not in [files] of {DECLARATION}")
    raw = contents[analysis.table].decode("utf-8-sig")
    rows = _matrix(raw) if analysis.read == "matrix" else pd.read_csv(io.StringIO(raw))
    for one in analysis.replace:
        for column in one.columns:
            chosen = _evaluated(rows, one.when.replace("{column}", column))
            rows[column] = rows[column].astype(object).mask(chosen.astype(bool), one.by)
    for column, text in analysis.join.items():
        rows[column] = [_filled(text, row) for row in rows.to_dict("records")]
    for column, text in analysis.columns.items():
        rows[column] = _evaluated(rows, text)
    return rows if analysis.where is None else rows[_evaluated(rows, analysis.where).astype(bool)]


def _matrix(raw: str) -> pd.DataFrame:
    """Items x people, one block per repetition: rows p00, p01, ..., columns s00, s01, ... made long."""
    blocks = [block.split() for block in re.split(r"\n[,\s]*\n", raw.strip())]
    votes = [
        (f"p{item:02}", f"s{person:02}", vote, repetition)
        for repetition, lines in enumerate(blocks)
        for item, line in enumerate(lines)
        for person, vote in enumerate(line.split(","))
        if vote != "nan"
    ]
    return pd.DataFrame(votes, columns=["item", "person", "rating", "repetition"])


_ALLOWED: tuple[type[ast.AST], ...] = (
    *(ast.Expression, ast.Name, ast.Load, ast.Constant, ast.List),
    *(ast.BinOp, ast.operator, ast.UnaryOp, ast.unaryop, ast.Compare, ast.cmpop, ast.BoolOp, ast.boolop),
)


def _evaluated(rows: pd.DataFrame, text: str) -> Any:
    """Arithmetic and comparisons of columns; nothing else, because a study may come from a stranger."""
    try:
        tree = ast.parse(text, mode="eval")
        if not all(isinstance(node, _ALLOWED) for node in ast.walk(tree)):
            raise ValueError("only columns, numbers, texts, arithmetic and comparisons are allowed")
        return rows.eval(text, engine="python")
    except (SyntaxError, ValueError, TypeError, NameError) as error:
        raise InputError(f"'{text}' in {DECLARATION}: {error}") from error


def _filled(text: str, row: Mapping[Any, Any]) -> str:
    try:
        return text.format_map({str(key): value for key, value in row.items()})
    except (KeyError, AttributeError, IndexError, ValueError) as error:
        raise InputError(
            f"'{text}' in {DECLARATION}: expected {{columns}} of the table, got {error}"
        ) from None


def _sentence(analysis: StudyAnalysis) -> Iterator[Figure]:
    """The number in each pair of braces of `form`."""
    if analysis.form is None:
        return
    parts = re.split(r"\{([^}]+)\}", analysis.form)
    pattern = "".join(
        re.escape(part) if number % 2 == 0 else r"(?:= )?([<>]? ?[-+−]?[\d.]+(?:e[-+]?\d+)?)"
        for number, part in enumerate(parts)
    )
    match = re.fullmatch(pattern, analysis.printed or "")
    if match is None:
        raise InputError(f"{analysis.name}: '{analysis.printed}' does not have the form '{analysis.form}'")
    for at, printed in zip(parts[1::2], match.groups(), strict=True):
        yield Figure(name=at, printed=printed, at=at)


def _printed_numbers(
    file: PrintedFile, contents: Mapping[str, bytes]
) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """A label, the column and the whole row of each number in a file of printed numbers."""
    if file.file not in contents:
        raise InputError(f"'{file.file}' is not in [files] of {DECLARATION}")
    text = contents[file.file].decode("utf-8-sig")
    if file.file.endswith(".json"):
        known = json.loads(text, parse_float=str, parse_int=str)
        for name, own in known.items():
            numbers = enumerate(own) if isinstance(own, list) else own.items()
            column = name if isinstance(own, list) else "value"
            for row, value in numbers if column in file.columns else ():
                yield f"{name} {row}", column, {"name": name, "row": row, column: value}
        return
    rows = pd.read_csv(io.StringIO(text), dtype=str)
    if file.where is not None:
        rows = rows[_evaluated(rows, file.where).astype(bool)]
    if unknown := {*file.label, *file.columns} - {*rows.columns}:
        raise InputError(f"{file.file} has no column '{min(unknown)}'; it has {', '.join(rows.columns)}")
    for record in rows.to_dict("records"):
        row = {str(key): value for key, value in record.items()}
        label = " ".join(str(row[key]) for key in file.label or row.keys() - file.columns.keys())
        for name in file.columns:
            yield f"{label} {name}", name, row


_OPERATORS = {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv}


def number_at(numbers: Any, address: str) -> float:
    """The number at an address in JSON, such as `items[name=a].mos` or `ci[1] - mean`.

    Raises
    ------
    InputError
        Where there is none.
    """
    parts = re.split(r" ([-+*/]) (?![^\[]*\])", address)
    value = _one_number(numbers, parts[0])
    for sign, part in zip(parts[1::2], parts[2::2], strict=True):
        value = float(_OPERATORS[sign](value, _one_number(numbers, part)))
    return value


def _one_number(numbers: Any, address: str) -> float:
    if re.fullmatch(r"[\d.]+", address):
        return float(address)
    at = numbers
    try:
        for key, chosen in re.findall(r"\[([^\]]*)\]|([^.\[\]]+)", address):
            at = _below(at, key, chosen)
        return float(at)
    except (KeyError, IndexError, TypeError, ValueError, StopIteration):
        raise InputError(f"the analysis has no number at '{address}'; look at its --json") from None


def _below(at: Any, bracket: str, key: str) -> Any:
    if "=" in bracket:
        selectors = [part.split("=", 1) for part in bracket.split(", ")]
        return next(one for one in at if all(str(_value_at(one, path)) == text for path, text in selectors))
    if bracket:
        return at[int(bracket)] if isinstance(at, list) else at[bracket]
    return at[key]


def _value_at(one: Any, path: str) -> Any:
    for key in path.split("."):
        one = one.get(key) if isinstance(one, dict) else None
    return one


def _comparison(analysis: str, figure: str, printed: str, numbers: Any, column: PrintedColumn) -> Comparison:
    ours = number_at(numbers, column.at)
    text = printed.replace("−", "-").replace(" ", "")
    sign = text[:1] if text[:1] in ("<", ">") else ""
    try:
        number = Decimal(text.removeprefix(sign))
        last_digit = int(number.as_tuple().exponent)  # that of 6e-04 is -4
    except (InvalidOperation, ValueError):
        raise InputError(f"{analysis}: {figure}: expected a printed number, got '{printed}'") from None
    if sign:
        bound = float(number)
        return Comparison(analysis, figure, printed, ours, ours < bound if sign == "<" else ours > bound)
    decimals = -last_digit if column.decimals is None else column.decimals
    allowed = 0.5 * 10.0**-decimals * (1 + 1e-9)
    if column.within is not None:
        allowed = column.within * (1.0 if column.of is None else abs(number_at(numbers, column.of)))
    return Comparison(analysis, figure, printed, ours, abs(ours - float(number)) <= allowed)


# The comparison as tables.

UNEXPLAINED = "study.toml gives no reason"


def studies_table(results: Sequence[Replication]) -> Table:
    """One row per study: how many printed numbers, and how many are equal."""
    rows = tuple(
        (
            one.name,
            one.study.title + (" (SYNTHETIC ratings)" if one.study.synthetic else ""),
            str(len(one.rows)) if not one.missing else DASH,
            str(one.n_equal) if not one.missing else "not shipped",
            str(len(one.rows) - one.n_equal) if not one.missing else DASH,
        )
        for one in results
    )
    notes = [f"{one.name}: {one.missing}." for one in results if one.missing]
    notes += [f"{one.name}: slow analyses were left out; add --slow." for one in results if one.left_out]
    if any(one.study.synthetic for one in results):
        notes.append("SYNTHETIC: a check of the pipeline on made-up ratings; this replicates nothing.")
    header = ("Study", "Title", "Printed", "Equal", "Differ")
    return Table(
        "replication", "Published studies, rebuilt from their raw files", header, rows, 2, tuple(notes)
    )


def differences_table(results: Sequence[Replication]) -> Table:
    """Every printed number that differs, and what was not rebuilt, with reasons."""
    rows = [
        (one.name, f"{row.analysis}: {row.figure}", row.printed, f"{row.ours:.6g}", row.reason or UNEXPLAINED)
        for one in results
        for row in one.rows
        if not row.equal or row.reason
    ]
    for one in results:
        for known in one.study.not_reproduced:
            if not one.missing and not any(row.reason == known.reason for row in one.rows):
                rows.append((one.name, known.figure, "not rebuilt", DASH, known.reason))
    header = ("Study", "Number", "Printed", "Ours", "Why")
    return Table("differences", "Not reproduced", header, tuple(rows), 5)


def rows_table(results: Sequence[Replication]) -> pd.DataFrame:
    """Every comparison, one row per printed number."""
    return pd.DataFrame([{"study": one.name, **vars(row)} for one in results for row in one.rows])
