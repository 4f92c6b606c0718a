"""Data written back into a TOML text: it says what was asked, and the rest stays as it was."""

import copy
import random
import re
import time
import tomllib
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.errors import InputError
from experiments.load import SHIPPED, DefinitionError, locate, parse_experiment
from server.studies.toml_edit import comments_of, with_data

EXP3 = locate("exp3").read_text(encoding="utf-8")
NAMES = st.sampled_from(["name", "value", "rule", "label", "en", "de", "x"])
SCALARS = st.one_of(
    st.booleans(), st.integers(-5, 5), st.floats(-2, 2, allow_nan=False), st.text("aä\n\"'\\#[]=", max_size=6)
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(NAMES, inner, max_size=4)),
    max_leaves=12,
)
TABLES = st.dictionaries(NAMES, VALUES, max_size=5)


@pytest.mark.parametrize("name", SHIPPED)
def test_unchanged_data_give_the_same_text(name: str) -> None:
    text = locate(name).read_text(encoding="utf-8")
    assert with_data(text, tomllib.loads(text)) == text


@given(before=TABLES, after=TABLES)
@settings(max_examples=150, deadline=None)
def test_any_edit_says_what_was_asked(before: dict[str, Any], after: dict[str, Any]) -> None:
    text = with_data("# a study\n", before)
    assert tomllib.loads(text) == before
    assert tomllib.loads(with_data(text, after)) == after


@given(seed=st.integers(0, 10_000))
@settings(max_examples=40, deadline=None)
def test_edits_of_a_shipped_declaration_keep_the_other_lines(seed: int) -> None:
    chance, data = random.Random(seed), tomllib.loads(EXP3)
    changed = copy.deepcopy(data)
    scalar = _random_place(changed, chance)
    scalar["zz"] = 7
    text = with_data(EXP3, changed)
    assert tomllib.loads(text) == changed
    lost = [line for line in EXP3.splitlines() if line not in text.splitlines()]
    assert len(lost) <= 1, lost


def _random_place(table: dict[str, Any], chance: random.Random) -> dict[str, Any]:
    """Some table of a declaration, however deep."""
    inner = [value for value in table.values() if isinstance(value, dict)]
    inner += [
        element
        for value in table.values()
        if isinstance(value, list)
        for element in value
        if isinstance(element, dict)
    ]
    return _random_place(chance.choice(inner), chance) if inner and chance.random() < 0.8 else table


COMMENTED = """\
# The study of lids
name = "a" # its name

# slow first
[[factors]]
name = "speed" # how fast
levels = [
    { name = "slow" }, # as recorded
    { name = "fast" },
]

# then mood
[[factors]]
name = "mood"

# rest
[practice]
trials = 4 # enough
"""


def _comments(text: str) -> set[str]:
    return set(re.findall(r"#[^\n]*", text))


def test_comments_go_with_the_element_that_they_are_above() -> None:
    data = tomllib.loads(COMMENTED)
    data["factors"].reverse()
    text = with_data(COMMENTED, data)
    assert _comments(text) == _comments(COMMENTED)
    assert text.index("# rest") > text.index('name = "speed"')


def test_a_removed_element_takes_its_own_comment_only() -> None:
    data = tomllib.loads(COMMENTED)
    del data["factors"][1]
    assert _comments(COMMENTED) - _comments(with_data(COMMENTED, data)) == {"# then mood"}


def test_a_further_level_keeps_the_lines_of_the_others() -> None:
    data = tomllib.loads(COMMENTED)
    data["factors"][0]["levels"].insert(1, {"name": "middle"})
    text = with_data(COMMENTED, data)
    assert '{ name = "slow" }, # as recorded' in text
    assert tomllib.loads(text) == data


def test_true_is_not_one_and_a_number_stays_as_it_is_written() -> None:
    assert with_data("a = true\nb = 60.0\n", {"a": 1, "b": 60}) == "a = 1\nb = 60.0\n"


def test_tables_out_of_order_are_written_whole() -> None:
    text = "[trial.scale]\nlow = 1\n[other]\nx = 1\n[trial.more]\ny = 2\n"
    data = tomllib.loads(text)
    data["trial"]["scale"]["low"] = 2
    data["trial"]["kind"] = "new"
    assert tomllib.loads(with_data(text, data)) == data


def test_text_that_is_not_toml_is_refused() -> None:
    with pytest.raises(InputError, match="not valid TOML"):
        with_data("name = ", {"name": "a"})


def test_a_text_beyond_editing_is_refused_in_one_line() -> None:
    deep = f"a = {'[' * 5000}{']' * 5000}"
    for text, data, told in (
        (deep, {"a": 1}, "nested too deeply"),
        (f"a = {list(range(2001))}", {"a": 1}, "at most 2000 elements"),
        ("a = 1", {"a": [[1] * 1000, [2] * 1000]}, "at most 2000 elements"),
    ):
        with pytest.raises(InputError, match=told) as refused:
            with_data(text, data)
        assert "\n" not in str(refused.value)
    with pytest.raises(DefinitionError, match="nested too deeply"):
        parse_experiment(deep)


def test_a_key_of_twenty_thousand_parts_is_refused_before_it_is_read() -> None:
    began = time.process_time()
    with pytest.raises(InputError, match="nested too deeply"):
        with_data("a" + ".a" * 40_000 + " = 1", {"title": "t"})
    assert time.process_time() - began < 2.0  # a reader takes ten seconds


@pytest.mark.parametrize("around", ["{}", "x = {{{}}}"])
def test_many_keys_of_many_parts_are_left_to_the_hand(around: str) -> None:
    keys = [".".join(["a"] * 30) + f".b{number} = 1" for number in range(100)]
    text, began = around.format((", " if "x" in around else "\n").join(keys)), time.process_time()
    with pytest.raises(InputError, match="manually"):
        with_data(text, {"title": "t"})
    assert time.process_time() - began < 2.0  # tomlkit takes eight seconds


def test_a_thousand_keys_of_three_parts_are_edited() -> None:
    text = "".join(f'texts.en.t{number} = "A. b. c. d. e."\n' for number in range(1000))
    data = tomllib.loads(text)
    data["texts"]["en"]["t7"] = "other"
    assert with_data(text, data) == text.replace('t7 = "A. b. c. d. e."', 't7 = "other"')


@pytest.mark.parametrize("text", ["\n" * 500_000, "# a\n" * 30_000])
def test_a_text_that_keeps_the_editor_busy_is_refused_before_it_is_read(text: str) -> None:
    """tomlkit makes an object of each line: 4 s for half a million empty ones, while others wait."""
    with pytest.raises(InputError, match="edit such a text manually"):
        with_data(text, {"a": 1})


def test_comments_are_found_and_what_only_looks_like_one_is_not() -> None:
    text = (
        '# 1\nname = "x" # short\ntitle = "# \\" # no"\nlist = [ # in\n1]\n# it\'s\n[a] #z\nb = \'# no\'\n'
        '[[c]] # table\nd = """\n# no \\""" # no\n"""\ne = \'\'\'\n# no\'\'\' # yes\n'
    )
    tomllib.loads(text)
    expected = ["# 1", "# short", "# in", "# it's", "#z", "# table", "# yes"]
    assert comments_of(text) == expected
