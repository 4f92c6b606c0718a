"""Every key is described and has an example; the examples are declarations that load."""

import tomllib

import pytest

from experiments.kinds import KINDS
from experiments.load import parse_experiment
from experiments.schema.effects import Key, keys
from tests.conftest import REPOSITORY
from tools.experiment_reference import EXAMPLES, Examples, experiment_reference, tables

KEYS = list({(key.path, key.model): key for key in keys()}.values())
EXAMPLE = Examples()
PAGE = "\n".join(experiment_reference("made"))


@pytest.mark.parametrize("key", KEYS, ids=lambda key: f"{key.model.__name__}.{key.name}")
def test_a_key_says_what_it_does_and_has_an_example(key: Key) -> None:
    described = key.field.description or ""
    assert described.endswith("."), f"{key.path} needs a sentence under it, in {key.model.__name__}"
    assert EXAMPLE.has(key), f"{key.path} of {key.model.__name__} is not set in {EXAMPLES.name}"


@pytest.mark.parametrize("name", KINDS)
def test_the_example_of_each_kind_is_of_its_kind(name: str) -> None:
    declared = tomllib.loads(KINDS[name].example)["trial"]
    assert KINDS[name].declaration.model_validate(declared).kind == name


def test_the_page_has_a_section_a_table_and_a_row_a_key() -> None:
    headings = [line for line in PAGE.splitlines() if line.startswith("## ")]
    assert len(headings) == len(set(headings)) == len(list(tables()))
    rows = [line for line in PAGE.splitlines() if line.startswith("| `")]
    assert len(rows) == sum(len(model.model_fields) for _, model, _ in tables())


def test_the_example_is_the_one_that_the_page_links_to() -> None:
    assert (REPOSITORY / "docs" / "reference" / "every-key.toml") == EXAMPLES
    experiment = parse_experiment(EXAMPLES.read_text(encoding="utf-8"), EXAMPLES.name)
    assert {rule.rule for rule in experiment.exclusions} == {
        key.field.default for key in KEYS if key.path == "exclusions.rule"
    }
