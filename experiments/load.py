"""Read an experiment from TOML (shipped by name, or a file) or from the JSON data of a database.

Problems in TOML include their line and a solution.
"""

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from experiments.consistency import check_consistency
from experiments.declaration.experiment import Experiment
from experiments.errors import InputError, and_others, did_you_mean, is_follower, nearest, wrong_value
from experiments.schema.effects import Key, is_tag
from experiments.schema.stored import upgrade_data

# Detect dotted keys that take seconds to parse, in one pass and before any parser reads the TOML text.

MAX_DEPTH = 32
"""Maximum nesting of tables and lists; dotted keys can make deep tables with a few letters per level."""
PART = r"""(?:[\w-]++|"(?>(?:[^"\\\n]++|\\[^\n])*)"|'[^'\n]*+')"""
"""One part of a dotted key, bare or quoted."""
_PARTS = re.compile(PART)
_DOT = r"[ \t]*+\.[ \t]*+"
# Without backtracking, and with the rest of an unclosed string consumed: each letter is read a few times at
# most. Groups repeat in atomic ones: Debian 12's Python 3.11.2 matches their possessive repeats wrongly.
_TOKEN = re.compile(
    r'"""(?>(?:[^"\\]++|\\.|"{1,2}+(?!"))*)(?:"{3,5}+|.*+)'
    r"|'''(?>(?:[^']++|'{1,2}+(?!'))*)(?:'{3,5}+|.*+)"
    r"|\#[^\n]*+"
    rf"|(?P<key>{PART}(?>(?:{_DOT}{PART}){{0,{MAX_DEPTH}}}))(?>(?P<beyond>{_DOT}{PART})?)"
    r"""|["'].*+""",
    re.DOTALL,
)


def has_endless_key(text: str) -> bool:
    """Whether a dotted key has more parts than the maximum nesting depth of tables.

    The time to parse a key grows with the square of its parts. Dots in texts and comments do not count. After
    the first mistake in a text, where every parser stops, the answer is meaningless.
    """
    return any(token["beyond"] is not None for token in _TOKEN.finditer(text))


def sum_of_cubes(text: str) -> int:
    """Sum of the cubes of the parts of every dotted key: the time that an editor of TOML takes grows like
    this."""
    keys = (token["key"] for token in _TOKEN.finditer(text))
    return sum(len(_PARTS.findall(key)) ** 3 for key in keys if key is not None and "." in key)


# Find the line of a key in TOML text, because the standard parser does not store positions.

_HEADER = re.compile(r"^\s*+(\[\[?+)([^\]]++)\]\]?+\s*+(#.*)?$")
_STRING_OR_COMMENT = re.compile(
    r'"""(?:\\.|[^\\])*?"{3,5}|\'\'\'.*?\'{3,5}|"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'|#[^\n]*', re.DOTALL
)
_PART = re.compile(rf"\s*+({PART}|[^.\s]++)\s*+")
_KEY = re.compile(r"^\s*([A-Za-z0-9_\-\"'.]+)\s*=")


def line_of(text: str, location: Sequence[object]) -> int | None:
    """Return the line (from 1) of the deepest part of `location` that is in `text`, or None.

    `location` is a path of keys and list indices, as pydantic reports it. Arrays of tables (`[[a]]`) count
    their headers; keys inside inline tables are found on the line of the table's own key.
    """
    places = _places(text)
    prefix = list(location)
    while prefix:
        # The key `a` of `[[a]]` has no separate line: the line of its first element is used.
        for key in (tuple(prefix), (*prefix, 0)):
            if key in places:
                return places[key]
        prefix.pop()
    return None


@lru_cache(maxsize=1)
def _places(text: str) -> dict[tuple[object, ...], int]:
    places: dict[tuple[object, ...], int] = {}
    counts: dict[tuple[object, ...], int] = {}
    here: tuple[object, ...] = ()
    depth = 0
    for number, line in enumerate(_without_strings(text).split("\n"), start=1):
        inside = depth > 0
        depth += sum(line.count(bracket) for bracket in "[{") - sum(line.count(bracket) for bracket in "]}")
        if inside:
            continue  # of a value over several lines
        header = _HEADER.match(line)
        if header is not None:
            here = _enter(_split(header[2]), header[1] == "[[", counts)
            places.setdefault(here, number)
            continue
        key = _KEY.match(line)
        if key is not None:
            places.setdefault((*here, *_split(key[1])), number)
    return places


def _without_strings(text: str) -> str:
    """The text with its strings and comments emptied; every line keeps its number."""

    def emptied(match: re.Match[str]) -> str:
        token = match[0]
        if token.startswith(('"""', "'''")):
            return '""' + "\n" * token.count("\n")
        # A quoted key contains a name; quoted values do not matter.
        return "" if token.startswith("#") else re.sub(r"[\[\]{}#=]", "_", token)

    return _STRING_OR_COMMENT.sub(emptied, text)


def _enter(keys: list[str], is_array: bool, counts: dict[tuple[object, ...], int]) -> tuple[object, ...]:
    """The path of a table header, with the index of the latest element for every array."""
    here: tuple[object, ...] = ()
    for position, key in enumerate(keys):
        here = (*here, key)
        last = position == len(keys) - 1
        if last and is_array:
            counts[here] = counts.get(here, -1) + 1
        if here in counts:
            here = (*here, counts[here])
    return here


def _split(dotted: str) -> list[str]:
    return [part.strip().strip("\"'") for part in _PART.findall(dotted)]


FOLDER = Path(__file__).parent
_LOCATION = re.compile(r"^([a-z_]+(?:\.(?:[a-z_]+|\d+))*): (.*)$")
SHIPPED = ("exp1", "exp2", "exp3")
DEMOS = (
    *("pairs-demo", "sliders-demo", "dcr-demo", "threshold-demo", "plane-demo", "checks-demo", "faces-demo"),
    *("timing", "timing-pairs", "timing-continuous"),
)
"""Demonstrations of the other kinds of trial and of sliders; each is found by its file name or its name."""


@dataclass(frozen=True)
class Problem:
    """One problem in a definition: where (line from 1, dotted path) and what to do."""

    line: int | None
    path: str
    message: str

    def __str__(self) -> str:
        line = f"line {self.line}: " if self.line else ""
        return f"{line}{self.path + ': ' if self.path else ''}{self.message}"


class DefinitionError(InputError):
    """A definition cannot be used; `problems` lists the reasons, and the message is the first.

    Parameters
    ----------
    number : int, optional
        How many reasons there are, if not all are listed.
    """

    def __init__(self, source: str, problems: Sequence[Problem], number: int | None = None) -> None:
        self.problems = tuple(problems)
        others = (number or len(problems)) - 1
        super().__init__(f"{source}: {problems[0]}{and_others(others)}")


class UnknownExperimentError(InputError):
    """A name that is neither a shipped experiment nor the path of a file.

    Parameters
    ----------
    said : str
        What is wrong, and what is expected.
    elsewhere : str
        Where a study made in the browser is found; empty for what cannot be one.
    """

    def __init__(self, said: str, elsewhere: str = "") -> None:
        self.said, self.elsewhere = said, elsewhere
        super().__init__(f"{said}. {elsewhere}" if elsewhere else said)


def load_experiment(name_or_path: str, *, has_data: bool = False) -> Experiment:
    """Load a shipped experiment by name, or the TOML file at a path; `has_data` as in `parse_experiment`."""
    path = locate(name_or_path)
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{path.name} is not UTF-8 text ({error.reason}); save it as UTF-8") from error
    return parse_experiment(text, path.name, has_data=has_data)


def is_shipped(name: str) -> bool:
    """Whether `load_experiment` takes this as the name of a shipped experiment."""
    return name.replace("_", "-") in (*SHIPPED, *DEMOS)


def locate(name_or_path: str) -> Path:
    """Return the path of the TOML file for a shipped experiment or a path; InputError if neither exists."""
    stem = name_or_path.replace("_", "-")
    if is_shipped(name_or_path):
        return FOLDER / f"{stem}.toml"
    path = Path(name_or_path)
    if path.is_file():
        return path
    if path.suffix == ".toml":
        raise InputError(
            f"there is no file {name_or_path}; expected a TOML file or one of {', '.join((*SHIPPED, *DEMOS))}"
        )
    raise _unknown_name(name_or_path, stem)


def _unknown_name(name: str, stem: str) -> UnknownExperimentError:
    """What to do about a name that is not shipped: one like it, a file without its ending, or a study."""
    names = (*SHIPPED, *DEMOS)
    expected = f"expected one of: {', '.join(names)}, or the path of a TOML file"
    if Path(f"{name}.toml").is_file():
        return UnknownExperimentError(
            f"no experiment '{name}'; there is a file {name}.toml here; to use it, give its whole name: "
            f"{name}.toml"
        )
    begins = (shipped for shipped in names if len(stem) > 3 and shipped.startswith(stem))
    near = next(begins, None) or nearest(stem, names, cutoff=0.7)
    said = f"no experiment '{name}'; " + (f"did you mean '{near}'? E{expected[1:]}" if near else expected)
    if "/" in name:
        return UnknownExperimentError(said)
    return UnknownExperimentError(
        said,
        "For a study made in the browser, press the button on its Design tab that downloads the definition "
        f"({name}.toml), and give the path of the downloaded file",
    )


MAX_PROBLEMS = 100
"""Maximum number of listed reasons; a text can contain a hundred thousand unknown keys."""
TOO_DEEP = "not valid TOML: lists or tables are nested too deeply"


def parse_experiment(text: str, source: str = "definition", *, has_data: bool = False) -> Experiment:
    """Parse and validate TOML text; DefinitionError lists every problem with its line.

    Parameters
    ----------
    has_data : bool
        Whether data were collected with it: values that an earlier version accepted, such as numbers in
        quotes, are still accepted.
    """
    data = toml_data(text, source)
    number = data.pop("format", 1)
    try:
        data = upgrade_data(data, number)
    except InputError as error:
        path, _, message = str(error).partition(": ")
        raise DefinitionError(source, [Problem(line_of(text, (path,)), path, message)]) from error
    try:
        # TOML distinguishes texts, numbers and booleans: none is accepted for another.
        experiment = Experiment.model_validate(_with_tuples(data), strict=not has_data)
    except ValidationError as error:
        # A misspelled key is also a missing one: report the misspelling first.
        causes = (detail for detail in error.errors() if not is_follower(detail))
        details = sorted(causes, key=lambda detail: detail["type"] == "missing")
        problems = [_problem(detail, text) for detail in details[:MAX_PROBLEMS]]
        raise DefinitionError(source, problems, len(details)) from error
    try:
        check_consistency(experiment, has_data=has_data)
    except ValueError as error:
        raise DefinitionError(source, [_unfit_part(str(error), text)]) from error
    return experiment


def load_stored(definition: Mapping[str, Any], number: int = 1) -> Experiment:
    """The declaration stored as JSON data of format `number`; InputError where it cannot be read."""
    data = upgrade_data(definition, number)
    try:
        experiment = Experiment.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        path = ".".join(str(part) for part in first["loc"])
        name = definition.get("name", "without a name")
        raise InputError(
            f"the stored definition {name} (format {number}) cannot be read: {path}: {wrong_value(first)}; "
            "use the version of this program that stored it, and report this"
        ) from error
    try:
        check_consistency(experiment, has_data=True)
    except ValueError as error:
        name = definition.get("name", "without a name")
        raise InputError(
            f"the stored definition {name} (format {number}) cannot be read: {error}; "
            "use the version of this program that stored it, and report this"
        ) from error
    return experiment


def _unfit_part(message: str, text: str) -> Problem:
    """A fault of parts that do not fit; its path precedes the message, and list items count from 1."""
    location, message = _located(message)
    return Problem(line_of(text, location), _dotted(location), message)


def _located(message: str) -> tuple[tuple[object, ...], str]:
    """The place that precedes a message, and the message; no place if the message names none."""
    named = _LOCATION.match(message)
    if not named:
        return (), message
    return tuple(int(part) - 1 if part.isdecimal() else part for part in named[1].split(".")), named[2]


def _dotted(location: Sequence[object]) -> str:
    return ".".join(str(part + 1) if isinstance(part, int) else str(part) for part in location)


def toml_data(text: str, source: str = "definition") -> dict[str, Any]:
    """Parse TOML text from any source; text that would take too long to parse is refused before parsing.

    Raises
    ------
    DefinitionError
        The text is not valid TOML, or its tables are nested too deeply.
    """
    if has_endless_key(text):
        raise DefinitionError(source, [Problem(None, "", TOO_DEEP)])
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        line = getattr(error, "lineno", None) or _line_in(str(error))
        raise DefinitionError(source, [Problem(line, "", f"not valid TOML: {error}")]) from error
    except ValueError as error:  # for a number longer than Python can parse
        problem = Problem(None, "", "not valid TOML: a number has too many digits")
        raise DefinitionError(source, [problem]) from error
    except RecursionError as error:
        raise DefinitionError(source, [Problem(None, "", TOO_DEEP)]) from error
    if is_deeper(data, MAX_DEPTH):
        raise DefinitionError(source, [Problem(None, "", TOO_DEEP)])
    return data


def is_deeper(data: Any, depth: int) -> bool:
    """Whether tables and lists are nested deeper than `depth`."""
    level = [data]
    for _ in range(depth + 1):
        level = [
            inner
            for one in level
            for inner in (one.values() if isinstance(one, dict) else one)
            if isinstance(inner, dict | list)
        ]
    return bool(level)


def _with_tuples(data: Any) -> Any:
    """The data with lists as tuples, which strict validation expects for a list."""
    if isinstance(data, dict):
        return {key: _with_tuples(value) for key, value in data.items()}
    return tuple(map(_with_tuples, data)) if isinstance(data, list) else data


def _line_in(message: str) -> int | None:
    digits = message.partition("at line ")[2].split(",")[0].split(" ")[0]
    return int(digits) if digits.isdigit() else None


def _problem(detail: Any, text: str) -> Problem:
    location = tuple(_without_tags(detail["loc"]))
    kind, message = detail["type"], wrong_value(detail | {"loc": location})
    if location and location[-1] == "[key]":  # The name of a table's key, which precedes it.
        location, message = location[:-1], f"the key {message}"
    if kind == "union_tag_invalid":
        location = (*location, detail["ctx"]["discriminator"].strip("'"))
        allowed = [tag.strip(" '") for tag in str(detail["ctx"]["expected_tags"]).split(",")]
        tag = str(detail["ctx"]["tag"])
        message = f"no such {location[-1]} '{tag}'{did_you_mean(tag, allowed)}"
    elif kind == "union_tag_not_found":
        message = f"the key {detail['ctx']['discriminator'].strip(chr(39))} is required and missing"
    elif kind == "extra_forbidden":
        word = str(location[-1])
        message = f"unknown key '{word}'{did_you_mean(word, _keys_at(detail['loc'][:-1]))}"
    elif not location:
        location, message = _located(message)
    return Problem(line_of(text, location), _dotted(location), message)


def _walk(location: Sequence[object]) -> Iterator[tuple[object, type[BaseModel], bool]]:
    """Each part of a path, the model after it, and whether the part only identifies a union member."""
    model: type[BaseModel] = Experiment
    tables: list[type[BaseModel]] = []
    for part in location:
        member = next((table for table in tables if _tag_of(table) == part), None)
        is_key = isinstance(part, str) and part in model.model_fields
        if member is not None:
            model = member
        elif isinstance(part, str) and is_key:
            tables = Key(part, model, model.model_fields[part]).tables
            model = tables[0] if tables else model
        yield part, model, member is not None and not is_key


def _without_tags(location: Sequence[object]) -> Iterator[object]:
    return (part for part, _, is_tag in _walk(location) if not is_tag)


def _keys_at(location: Sequence[object]) -> list[str]:
    """The keys allowed at a place in the declaration, by walking the models."""
    models: list[type[BaseModel]] = [Experiment, *(model for _, model, _ in _walk(location))]
    return list(models[-1].model_fields)


def _tag_of(model: type[BaseModel]) -> object:
    return next((field.default for field in model.model_fields.values() if is_tag(field)), None)
