"""What the columns of a table may be, and the analysis that fits them: guesses for a person to confirm."""

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.read.number_columns import MISSING_MARKS, holds_numbers
from analysis.read.reading import OF_AN_EXPORT, rows_with_names, said_of_mixed
from analysis.read.text_table import EMPTY, read_text_table
from analysis.read.wide import wide_hint
from experiments.columns.column import OLD_ORDER
from experiments.files import as_argument
from table_files import InputError, counted

MISSING = EMPTY | MISSING_MARKS
MAX_LEVELS = 12
"""A factor of a factorial design rarely has more."""
SHOWN_VALUES = 6
YES_OR_NO = {"0", "1", "yes", "no", "true", "false", "correct", "wrong"}

NO_FACTOR = (
    r"repetitions?|repeats?|trials?|trial.?(?:index|number)|blocks?|orders?|sessions?|runs?|index|rows?"
    r"|.*rating.*|.*_id"
)
"""Columns with few values that separate rows and were not varied."""
_DATE = r"\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{2,4}"
_CLOCK = r"\d{1,2}:\d{2}(?::\d{2}(?:[.,]\d+)?)?(?: ?[AaPp][Mm])?(?: ?(?:Z|UTC|[+-]\d{2}:?\d{2}))?"
_TIME = re.compile(rf"(?:{_DATE})(?:(?:T|,? ){_CLOCK})?|{_CLOCK}")

ROLES = (
    *("participant", "rating", "within", "between", "covariate", "item"),
    *("left", "right", "winner", "x", "response", "by"),
)
# Whole names first: of `participant` and `participant_age`, the former is the person.
NAMES: Mapping[str, str] = {
    "participant": r"participants?|subjects?|subj|sub|persons?|people|observers?|raters?|users?|workers?|"
    r"pid|ppt|prolific.?(?:p?id)?|respondents?|id|.*(?:participant|subject|observer|prolific|worker).*id",
    "left": r"left|item.?1|stim(?:ulus)?.?[a1]|option.?[a1]|condition.?[a1]|first|a",
    "right": r"right|item.?2|stim(?:ulus)?.?[b2]|option.?[b2]|condition.?[b2]|second|b",
    "winner": r"winner|is.?a.?selected|selected|selection|choice|chosen|preferred|preference",
    "response": r"responses?|answers?|correct|seen|detected|resp|yes",
    "rating": r"ratings?|scores?|responses?|mos|votes?|opinions?|opinion.?scores?|values?|answers?|dv|y|"
    r"naturalness|quality|.*(?:rating|score).*",
    "item": r"items?|clips?|videos?|stimul(?:us|i)|stim|images?|files?|pvs|.*(?:stimulus|clip|video|item).*",
    "by": r"contents?|scenes?|sources?|src|criteri(?:on|a)|questions?",
    "x": r"x|durations?|contrasts?|intensit(?:y|ies)|levels?|.*(?:_ms|duration|intensity).*",
}


@dataclass(frozen=True)
class ColumnGuess:
    """What a column holds, and the role that it probably has.

    Attributes
    ----------
    is_number : bool
        Whether every value is a number, apart from marks of missing values.
    n_values, n_missing : int
        Different values, and rows without one.
    values : tuple of str
        The first few values, or the lowest and the highest number.
    role : str
        Empty where the column takes no part.
    """

    name: str
    is_number: bool
    n_values: int
    n_missing: int
    values: tuple[str, ...]
    role: str


@dataclass(frozen=True)
class TableGuess:
    """A table's columns and the command of `analysis` that fits them; empty where none does."""

    n_rows: int
    columns: tuple[ColumnGuess, ...]
    command: str
    decisions: tuple[str, ...] = ()

    def command_line(self, file: str) -> str:
        """The whole command for a shell."""
        # A guess may suit another analysis than this one.
        taken = [role for roles in OPTIONS[self.command] for role in roles]
        roles = {column.name: column.role for column in self.columns if column.role in taken}
        return shown_command(self.command, file, options_of(self.command, roles))


def shown_command(command: str, file: str, options: Sequence[str]) -> str:
    """A command of `analysis` on a file, as it is typed in a shell."""
    return f"analysis {command} {as_argument(file)} {shlex.join(options)}"


# Which roles each command takes, by its options; those that must be given first.
OPTIONS: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "anova": (("participant", "rating"), ("within", "between", "covariate")),
    "mixed": (("participant", "rating"), ("item", "within", "between", "covariate")),
    "ordinal": (("participant", "rating"), ("item", "within", "between", "covariate")),
    "ranks": (("participant", "rating"), ("within", "between")),
    "t-test": (("participant", "rating"), ("between",)),
    "opinion": (("item", "participant", "rating"), ()),
    "agreement": (("item", "participant", "rating"), ()),
    "pairs": (("left", "right", "winner"), ("participant", "by")),
    "thresholds": (("x", "response"), ("participant", "by")),
}
SEVERAL = ("within", "between", "covariate")
"""Options that take several columns, separated by commas, but in `ranks` and `t-test`."""
ONE_FACTOR = ("ranks", "t-test")


def options_of(command: str, roles: Mapping[str, str]) -> list[str]:
    """The options of a command from the roles of the columns.

    Parameters
    ----------
    command : str
        A key of `OPTIONS`.
    roles : mapping of str to str
        Role of each column.

    Raises
    ------
    InputError
        The command is unknown or does not take a role; a role that it needs has no column, or a role of one
        column has several.
    """
    if command not in OPTIONS:
        raise InputError(f"expected an analysis ({', '.join(OPTIONS)}), got '{command}'")
    needed, optional = OPTIONS[command]
    for name, role in roles.items():
        if role not in (*needed, *optional):
            raise InputError(
                f"analysis {command} takes no column for '{role}', got '{name}'; remove its role, or choose "
                "another analysis"
            )
    options = []
    for role in (*needed, *optional):
        names = [name for name, own in roles.items() if own == role]
        if not names and role in needed:
            raise InputError(f"analysis {command} needs a column for {role}; choose one")
        if len(names) > 1 and (role not in SEVERAL or command in ONE_FACTOR):
            raise InputError(
                f"analysis {command} takes one column for {role}, got {', '.join(names)}; choose one"
            )
        if unusable := [name for name in names if "," in name]:
            raise InputError(f"'{unusable[0]}' has a comma in its name; rename the column")
        options += [f"--{role}={','.join(names)}"] if names else []
    if command in ("anova", *ONE_FACTOR) and not {*roles.values()} & {*SEVERAL}:
        raise InputError(f"analysis {command} needs a factor; choose a column for within or between")
    return options


def guess_roles(path: Path) -> TableGuess:
    """Read a table and guess what its columns are.

    Parameters
    ----------
    path : pathlib.Path
        Any table that the commands read.

    Raises
    ------
    InputError
        As `read_text_table`.

    Notes
    -----
    A name says what a column is; where no name does, its values do. A factor has 2 to 12 different
    values. It lies between participants where each of them has one value, and else within.
    """
    table = read_text_table(path, None, copies=False)
    texts = {name: table.columns[name].astype(str) for name in table.header}
    numbers = {name: holds_numbers(column.unique()) for name, column in texts.items()}
    roles = _named_roles(texts, numbers)
    command = _fitting_command(texts, numbers, roles)
    if command:
        needed, optional = OPTIONS[command]
        # The item stays in sight where there are ratings: mixed models of the same table take it.
        taken = (*needed, *optional, *(("item",) if "rating" in needed else ()))
        roles = {name: role for name, role in roles.items() if role in taken}
    columns = tuple(_described(name, texts[name], numbers[name], roles.get(name, "")) for name in texts)
    hint = "" if command else wide_hint(table.header)
    decisions = [*table.decisions, *([hint.removeprefix("; ")] if hint else [])]
    # Otherwise the command that is proposed would only refuse the table.
    is_export = {*table.header} >= OF_AN_EXPORT
    if command and is_export and (mixed := said_of_mixed(table, rows_with_names(table), list(roles))):
        decisions.append(f"the command below refuses this table as it is: {mixed}")
    return TableGuess(len(table.columns), columns, command, tuple(decisions))


def _present(column: "pd.Series[str]") -> "pd.Series[str]":
    return column[~column.isin(MISSING)]


def _named_roles(texts: Mapping[str, "pd.Series[str]"], numbers: Mapping[str, bool]) -> dict[str, str]:
    """Roles by name, each once; what the platform's own exports add to every row has none."""
    known = {name for names in OLD_ORDER.values() for name in names}
    is_export = {"participant", "trial_index", "definition_sha256"} <= {*texts}
    roles: dict[str, str] = {}
    for role in ("participant", "left", "right", "winner", "rating", "item"):
        fitting = [
            name
            for name in texts
            if name not in roles
            and re.fullmatch(NAMES[role], name.strip(), re.IGNORECASE)
            and (role != "rating" or (numbers[name] and _present(texts[name]).nunique() > 1))
        ]
        if is_export:
            own = {"rating": "response", "item": "stimulus"}.get(role, role)
            fitting = [name for name in fitting if name == own]
        # The pattern lists whole names before parts of names.
        whole = [name for name in fitting if _is_whole(role, name)]
        if fitting:
            roles[(whole or fitting)[0]] = role
    # Only all three are a comparison: a single column of these names may be a factor.
    if not {"left", "right", "winner"} <= {*roles.values()}:
        roles = {name: role for name, role in roles.items() if role not in ("left", "right", "winner")}
    person = next((name for name, role in roles.items() if role == "participant"), None)
    for name, column in texts.items():
        if name in roles or (is_export and name in known):
            continue
        values = _present(column)
        if re.fullmatch(NO_FACTOR, name.strip(), re.IGNORECASE):
            continue
        if re.fullmatch("age", name.strip(), re.IGNORECASE) and numbers[name]:
            roles[name] = "covariate"
        # A column whose every value differs names the rows and was not varied.
        elif (
            2 <= values.nunique() <= MAX_LEVELS and values.nunique() < len(values) and not _are_times(values)
        ):
            if person is None or not _one_value_each(column, texts[person]):
                roles[name] = "within"
            elif _forms_groups(values, texts[person]):
                roles[name] = "between"
    if (
        person is not None
        and "rating" not in roles.values()
        and (measure := _likely_measure(texts, numbers, roles))
    ):
        roles[measure] = "rating"
    return roles


def _likely_measure(
    texts: Mapping[str, "pd.Series[str]"], numbers: Mapping[str, bool], roles: Mapping[str, str]
) -> str | None:
    """The one column of numbers that is left; None if there is none, or a choice."""
    left = [name for name in texts if numbers[name] and roles.get(name, "within") == "within"]
    left = [name for name in left if not re.fullmatch(NO_FACTOR, name, re.IGNORECASE) and name not in roles]
    many = [name for name in left if _present(texts[name]).nunique() > MAX_LEVELS]
    return many[0] if len(many) == 1 else None


def _is_whole(role: str, name: str) -> bool:
    """Whether a name is one of the pattern's words, not only around one."""
    # Split at bars outside parentheses only: those inside belong to one word.
    words = "|".join(part for part in re.split(r"\|(?![^(]*\))", NAMES[role]) if ".*" not in part)
    return re.fullmatch(words, name.strip(), re.IGNORECASE) is not None


def _are_times(values: "pd.Series[str]") -> bool:
    return all(_TIME.fullmatch(value.strip()) for value in values.unique())


def _forms_groups(values: "pd.Series[str]", people: "pd.Series[str]") -> bool:
    """Whether people share values; else nearly every value is of one person, as with a time or a comment."""
    return 3 * values.nunique() <= 2 * people[values.index].nunique()


def _one_value_each(column: "pd.Series[str]", people: "pd.Series[str]") -> bool:
    return bool((column.groupby(people.to_numpy()).nunique() <= 1).all())


def _fitting_command(
    texts: Mapping[str, "pd.Series[str]"], numbers: Mapping[str, bool], roles: dict[str, str]
) -> str:
    """The command that fits the roles; roles of a threshold are only given here, since any table has them."""
    have = {*roles.values()}
    if {"left", "right", "winner"} <= have:
        named = [name for name in texts if re.fullmatch(NAMES["by"], name.strip(), re.IGNORECASE)]
        if named and _present(texts[named[0]]).nunique() > 1:
            roles[named[0]] = "by"
        return "pairs"
    if (pair := _threshold_columns(texts, numbers)) is not None:
        for name in [name for name, role in roles.items() if role in ("rating", "item") or name in pair]:
            roles.pop(name)
        roles[pair[0]], roles[pair[1]] = "x", "response"
        conditions = [name for name, role in roles.items() if role in ("within", "between")]
        for name in conditions:
            roles.pop(name)
        if conditions:
            roles[conditions[0]] = "by"
        return "thresholds"
    if not {"participant", "rating"} <= have:
        return ""
    if have & {"within", "between"}:
        return "anova"
    return "opinion" if "item" in have else ""


def _threshold_columns(
    texts: Mapping[str, "pd.Series[str]"], numbers: Mapping[str, bool]
) -> tuple[str, str] | None:
    """The columns of the stimulus and of a yes or no, both by their names; None for another table."""
    strengths = [name for name in texts if numbers[name] and re.fullmatch(NAMES["x"], name, re.IGNORECASE)]
    answers = [
        name
        for name, column in texts.items()
        if re.fullmatch(NAMES["response"], name, re.IGNORECASE)
        and {*_present(column).str.casefold().unique()} <= YES_OR_NO
        and _present(column).nunique() == 2
    ]
    return (strengths[0], answers[0]) if strengths and answers else None


def _described(name: str, column: "pd.Series[str]", is_number: bool, role: str) -> ColumnGuess:
    values = _present(column)
    seen: Sequence[str] = list(values.unique()[:SHOWN_VALUES])
    if is_number and values.nunique() > SHOWN_VALUES:
        parsed = pd.to_numeric(values.str.replace(",", ".", regex=False)).to_numpy(dtype=np.float64)
        seen = [f"{parsed.min():g}", f"{parsed.max():g}"]
    return ColumnGuess(name, is_number, int(values.nunique()), len(column) - len(values), tuple(seen), role)


def said_of_values(column: ColumnGuess) -> str:
    """What a column holds, in a few words: `numbers from 1 to 7`, `4 texts: both, none, ...`."""
    if not column.values:
        return "nothing"
    if column.is_number and column.n_values > SHOWN_VALUES:
        return f"{counted(column.n_values, 'number')} from {column.values[0]} to {column.values[1]}"
    more = ", ..." if column.n_values > len(column.values) else ""
    kind = "number" if column.is_number else "text"
    return f"{counted(column.n_values, kind)}: {', '.join(column.values)}{more}"
