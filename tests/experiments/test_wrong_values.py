"""Every key answers a value of a wrong type alike: its line, what was expected, what came."""

import copy
import datetime
import re
import tomllib
from collections.abc import Iterator
from typing import Any

import pytest
import tomli_w

from experiments.declaration.experiment import Experiment
from experiments.errors import PATTERNS, wrong_value
from experiments.load import DefinitionError, locate, parse_experiment
from tests.conftest import REPOSITORY

FILES = ("docs/reference/every-key.toml", "docs/reference/lists.toml")
DEMOS = ("pairs-demo", "sliders-demo", "threshold-demo", "plane-demo", "dcr-demo", "timing-continuous")
WRONG = (
    *(3, 2.5, "zz", True, float("nan"), 10**30, datetime.date(2026, 1, 2), datetime.time(1, 2)),
    *([], ["a"], [["a", "b"]], [[[1]]], {}, {"a": 1}, [{"a": 1}]),
)
OF_PYDANTIC = re.compile(
    r"Input should|[Tt]uple|dictionary|instance of|String should|Field required|Extra inputs"
)


def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Every key and the first two items of every list."""
    pairs = value.items() if isinstance(value, dict) else []
    pairs = enumerate(value[:2]) if isinstance(value, list) else pairs
    for key, inner in pairs:
        yield (*path, key)
        yield from places(inner, (*path, key))


def replaced(data: dict[str, Any], path: tuple[Any, ...], value: Any) -> tuple[Any, dict[str, Any]]:
    """What stood at a place, and the data with another value there."""
    changed = copy.deepcopy(data)
    inner: Any = changed
    for key in path[:-1]:
        inner = inner[key]
    before, inner[path[-1]] = inner[path[-1]], value
    return before, changed


def fits(before: Any, value: Any) -> bool:
    """Whether a value may be right where `before` was: of its type, or a whole number for a number."""
    return type(before) is type(value) or (isinstance(before, float) and type(value) is int)


@pytest.mark.parametrize("file", [*FILES, *(f"experiments/{name}.toml" for name in DEMOS)])
def test_each_key_refuses_other_types_with_its_line_and_what_came(file: str) -> None:
    data = tomllib.loads((REPOSITORY / file).read_text(encoding="utf-8"))
    # One wrong value per place, in turn: over the places of a file each comes many times.
    for number, path in enumerate(places(data)):
        wrong = [value for value in WRONG if not fits(replaced(data, path, value)[0], value)]
        value = wrong[number % len(wrong)]
        _, changed = replaced(data, path, value)
        if path == ("render", "character") and isinstance(value, list):
            continue  # A list of characters is a factor of its own.
        text = tomli_w.dumps(changed)
        with pytest.raises(DefinitionError) as refused:
            parse_experiment(text)
        for problem in refused.value.problems:
            assert not OF_PYDANTIC.search(str(problem)), (path, value, problem)
            assert "\n" not in str(problem)
        assert any(names(problem, path, text) for problem in refused.value.problems), (
            path,
            value,
            refused.value.problems,
        )


def names(problem: Any, path: tuple[Any, ...], text: str) -> bool:
    """Whether a problem is of this place, or of a table around it, and leads to the line of a key in it."""
    place = tuple(key + 1 if isinstance(key, int) else key for key in path)
    parts = tuple(int(part) if part.isdigit() else part for part in problem.path.split("."))
    if not problem.path or parts[0] != place[0]:
        return False
    line = text.splitlines()[problem.line - 1] if problem.line else ""
    return any(str(part) in line for part in parts)


EXP1 = (REPOSITORY / "experiments" / "exp1.toml").read_text(encoding="utf-8")


LISTED = 'languages = ["en", "de"]'
PER_CELL = "exemplars.per_cell: expected a whole number, got"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("per_cell = 20", 'per_cell = "20"', f"{PER_CELL} '20'"),
        ("per_cell = 20", "per_cell = true", f"{PER_CELL} true"),
        ("per_cell = 20", "per_cell = [20]", f"{PER_CELL} the list [20]"),
        ("per_cell = 20", "per_cell = 0", "exemplars.per_cell: expected 1 or more, got 0"),
        ("motion_blur = false", "motion_blur = 0", "render.motion_blur: expected true or false, got 0"),
        (LISTED, 'languages = [["en"]]', 'languages.1: expected a text in quotes, got the list ["en"]'),
        (LISTED, 'languages = "en"', "languages: expected a list, got 'en'"),
        (LISTED, "languages = []", "languages: expected a list of 1 item or more, got an empty list"),
        (LISTED, "languages = [1979-05-27]", "languages.1: expected a text in quotes, got 1979-05-27"),
        ("[exemplars]", "[[exemplars]]", "a table is written [exemplars]"),
        ('kind = "clip_rating"', "kind = 3", "trial.kind: no such kind '3'; expected one of: clip_rating, "),
    ],
)
def test_what_was_expected_and_what_came(old: str, new: str, words: str) -> None:
    assert old in EXP1
    text = EXP1.replace(old, new, 1)
    with pytest.raises(DefinitionError) as refused:
        parse_experiment(text, "mine.toml")
    (said,) = [problem for problem in refused.value.problems if words in str(problem)]
    assert new in text.splitlines()[(said.line or 0) - 1]


def test_one_table_for_several_gets_a_message_how_they_are_written() -> None:
    with pytest.raises(DefinitionError, match=r"line 1: factors: expected a list, .* \[\[factors\]\]"):
        parse_experiment('[factors]\nname = "speed"\n')


def test_long_values_are_cut_off_and_the_nearest_word_is_named() -> None:
    long = {"type": "int_type", "loc": ("a",), "input": list(range(99)), "msg": ""}
    assert wrong_value(long).endswith("...")
    assert len(wrong_value(long)) < 110
    choice = {"expected": "'full' or 'natural'"}
    near = {"type": "literal_error", "loc": ("a",), "input": "natrual", "msg": "", "ctx": choice}
    assert wrong_value(near) == "expected one of 'full' or 'natural', got 'natrual'; did you mean 'natural'?"


def test_what_earlier_versions_took_is_still_read_where_there_are_data_by_it() -> None:
    text = locate("sliders-demo").read_text(encoding="utf-8")
    quoted = re.sub(r"\nparticipants = (\d+)", r'\nparticipants = "\1"', text, count=1)
    assert quoted != text
    with pytest.raises(DefinitionError, match="participants: expected a whole number"):
        parse_experiment(quoted)
    assert parse_experiment(quoted, has_data=True) == parse_experiment(text)


def test_no_answer_shows_a_regular_expression() -> None:
    assert (
        set(re.findall(r"'pattern': '(.*?)'[,}]", str(Experiment.model_json_schema())))
        - {pattern.replace("\\", "\\\\") for pattern in PATTERNS}
        == set()
    )
    text = (REPOSITORY / "experiments/pairs-demo.toml").read_text(encoding="utf-8")
    with pytest.raises(DefinitionError, match="expected a name of letters"):
        parse_experiment(re.sub(r'name = "[^"]*"', 'name = ""', text, count=1))
