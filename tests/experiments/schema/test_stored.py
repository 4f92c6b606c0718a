"""Definitions stored by every format are read, and keep the hash that is stored with their answers."""

import json
from pathlib import Path
from typing import Annotated, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.declaration.base import IMPLIED, Declaration
from experiments.errors import InputError
from experiments.load import DefinitionError, load_experiment, load_stored, locate, parse_experiment
from experiments.schema.canonical import canonical, definition_sha256
from experiments.schema.effects import keys
from experiments.schema.stored import FORMAT, Step, earlier_names, upgrade_data
from tests.conftest import REPOSITORY

FORMATS = sorted((REPOSITORY / "tests" / "golden" / "definitions").glob("format_*"))
STORED = [path for folder in FORMATS for path in sorted(folder.glob("exp*.toml"))]
IDS = [f"{path.parent.name}-{path.stem}" for path in STORED]


def hash_then(path: Path) -> str:
    return str(json.loads((path.parent / "hashes.json").read_text(encoding="utf-8"))[path.stem])


def number_of(path: Path) -> int:
    return int(path.parent.name.removeprefix("format_"))


def test_every_format_has_its_definitions() -> None:
    assert [path.name for path in FORMATS] == [f"format_{number}" for number in range(1, FORMAT + 1)]


@pytest.mark.parametrize("path", STORED, ids=IDS)
def test_a_definition_keeps_the_hash_it_was_stored_with(path: Path) -> None:
    assert definition_sha256(parse_experiment(path.read_text(encoding="utf-8"))) == hash_then(path)


@pytest.mark.parametrize("path", STORED, ids=IDS)
def test_what_a_database_holds_is_the_same_definition(path: Path) -> None:
    stored = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
    experiment = load_stored(stored, number_of(path))
    assert experiment == parse_experiment(path.read_text(encoding="utf-8"))
    assert definition_sha256(experiment) == hash_then(path)


@pytest.mark.parametrize("name", ["exp1", "exp2", "exp3"])
def test_what_is_stored_by_this_format_is_read_again(name: str) -> None:
    experiment = load_experiment(name)
    assert load_stored(json.loads(experiment.model_dump_json()), FORMAT) == experiment


class Before(Declaration):
    size: int = 3
    parts: tuple["Part", ...] = ()


class Part(Declaration):
    label: str = "a"
    width: float = 1.0


class After(Declaration):
    """A key has another name, and two keys are new."""

    extent: int = 3
    parts: tuple["WidePart", ...] = ()
    colour: str = "grey"


class WidePart(Declaration):
    label: str = "a"
    breadth: float = 1.0
    deep: bool = False
    kind: Annotated[str, IMPLIED] = "wide"


Before.model_rebuild()
After.model_rebuild()
STEPS = (Step(renamed={"size": "extent", "parts.width": "breadth"}),)
ALWAYS = frozenset(key.path for key in keys(Before))
PARTS = st.lists(st.builds(Part, label=st.sampled_from("ab"), width=st.sampled_from([1.0, 2.5])), max_size=3)


@given(st.builds(Before, size=st.integers(1, 4), parts=PARTS.map(tuple)))
def test_new_and_renamed_keys_leave_the_canonical_form_alone(before: Before) -> None:
    after = After.model_validate(upgrade_data(before.model_dump(), 1, STEPS))
    assert [part.breadth for part in after.parts] == [part.width for part in before.parts]
    form = canonical(before, ALWAYS, {})
    assert form == before.model_dump(mode="json", exclude_none=False) | {"parts": form["parts"]}
    assert canonical(after, ALWAYS, earlier_names(STEPS)) == form
    changed = after.model_copy(update={"colour": "red"})
    assert canonical(changed, ALWAYS, earlier_names(STEPS)) == form | {"colour": "red"}


def test_a_key_renamed_twice_is_hashed_under_its_first_name() -> None:
    steps = (Step(renamed={"trial.a": "b"}), Step(renamed={"trial.b": "c"}))
    assert earlier_names(steps) == {"trial.c": "a"}
    assert upgrade_data({"trial": {"a": 1}}, 1, steps) == {"trial": {"c": 1}}
    assert upgrade_data({"trial": {"b": 1}}, 2, steps) == {"trial": {"c": 1}}


def test_a_step_may_do_more_than_rename() -> None:
    def double(data: dict[str, Any]) -> None:
        data["size"] *= 2

    stored = {"size": 2}
    assert upgrade_data(stored, 1, (Step(change=double),)) == {"size": 4}
    assert stored == {"size": 2}


@pytest.mark.parametrize("number", [0, -1, FORMAT + 1, "1", True, None, 1.0])
def test_a_format_that_nobody_knows_is_one_line(number: object) -> None:
    with pytest.raises(InputError, match=r"^format: ") as raised:
        upgrade_data({}, number)
    assert "\n" not in str(raised.value)
    assert str(FORMAT) in str(raised.value)


def test_a_toml_may_name_its_format() -> None:
    text = (REPOSITORY / "experiments" / "exp1.toml").read_text(encoding="utf-8")
    assert parse_experiment(f"format = 1\n{text}") == load_experiment("exp1")
    with pytest.raises(DefinitionError, match=r"line 2: format: this program reads formats 1 to .* got 99"):
        parse_experiment(f"# from the future\nformat = 99\n{text}")


def test_a_stored_definition_that_cannot_be_read_is_one_line() -> None:
    stored = json.loads(load_experiment("exp1").model_dump_json()) | {"unheard_of": 1}
    with pytest.raises(InputError, match=r"stored definition exp1 .* unheard_of") as raised:
        load_stored(stored)
    assert "\n" not in str(raised.value)


def test_a_name_that_has_become_a_column_since_still_loads_but_is_refused_in_a_new_declaration() -> None:
    text = locate("exp1").read_text(encoding="utf-8")
    stored = json.loads(parse_experiment(text).model_dump_json())
    taken = json.loads(json.dumps(stored).replace('"blur"', '"run_origin"'))
    assert "run_origin" in load_stored(taken).factor_names
    with pytest.raises(DefinitionError, match="'run_origin' has the name of a ratings column"):
        parse_experiment(text.replace('"blur"', '"run_origin"'))
