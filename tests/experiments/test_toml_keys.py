"""Dotted keys without end are seen before a reader gets the text; dots of texts and comments are none."""

import time
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.load import (
    MAX_DEPTH,
    SHIPPED,
    DefinitionError,
    has_endless_key,
    load_experiment,
    locate,
    parse_experiment,
    toml_data,
)

LONGEST = 500_000
SOON_S = 5.0
"""Hundredths of a second on an idle machine; by a search that pairs quotes again and again, minutes."""


@pytest.mark.parametrize(
    "text",
    [
        "a" + ".a" * 40_000 + " = 1",
        "a" + " . 'b'\t.\"c.d\"" * 20_000 + " = 1",
        "[[a" + ".a" * 40_000 + "]]",
        'x = {y = """ " """, ' + ("a." * 400 + '"b".') * 100 + 'a = "x"}',
        "x = {y = ''' ' ''', " + "a." * 400 + "a = 1}",
        'x = """a""""" # "\ny' + ".a" * 400 + " = 1",
        'x = "\\\\" # "\ny' + ".a" * 400 + " = 1",
        "x = '\\' # '\ny" + ".a" * 400 + " = 1",
    ],
)
def test_a_key_without_end_is_seen_wherever_it_is(text: str) -> None:
    assert has_endless_key(text)
    with pytest.raises(DefinitionError, match="nested too deeply"):
        toml_data(text)


@pytest.mark.parametrize("beginning", ["", 'a = "', 'a = """', "[", "x = {y = "])
@pytest.mark.parametrize("unit", ['\\"', '"', "'", "a.", 'a."', "a.'", '"\\', "' ", "a ", "a\n", ".", '.".'])
def test_no_text_keeps_the_search_or_the_reader_busy(beginning: str, unit: str) -> None:
    text, began = beginning + unit * (LONGEST // len(unit)), time.process_time()
    with pytest.raises(DefinitionError):
        toml_data(text)
    assert time.process_time() - began < SOON_S


@pytest.mark.parametrize("quotes", ['"', "'", '"""', "'''"])
def test_a_title_of_many_sentences_is_not_a_key(quotes: str) -> None:
    for title in ("Yes. " * 501, "1.2." * 4001, "a.b." * 4001):
        text = f"title = {quotes}{title}{quotes} # {title}"
        assert toml_data(text) == {"title": title}


def test_stored_studies_load_with_a_title_of_any_length() -> None:
    text = locate("exp1").read_text(encoding="utf-8")
    experiment = load_experiment("exp1")
    title = experiment.title["en"] if isinstance(experiment.title, dict) else experiment.title
    longer = text.replace(f'"{title}"', f'"{"Yes. " * 501}"', 1)
    assert longer != text
    parse_experiment(longer, has_data=True)


def test_the_bound_is_that_of_tables_in_one_another() -> None:
    for parts, is_refused in ((MAX_DEPTH + 1, False), (MAX_DEPTH + 2, True)):
        text = ".".join(["a"] * parts) + " = 1"
        assert has_endless_key(text) == is_refused


@pytest.mark.parametrize("name", SHIPPED)
def test_no_shipped_definition_has_one(name: str) -> None:
    assert not has_endless_key(locate(name).read_text(encoding="utf-8"))


words = st.text(alphabet="a.\"'\\#\n ={}", max_size=12)


@given(st.lists(words, min_size=1, max_size=4), st.integers(0, MAX_DEPTH + 3))
def test_whatever_is_in_texts_the_keys_after_them_are_counted(texts: list[str], dots: int) -> None:
    lines = []
    for number, text in enumerate(texts):
        escaped = text.replace("\\", "\\\\").replace('"', '\\"')
        lines.append(f'key{number} = """{escaped}""" # {escaped.splitlines()[0] if escaped else ""}')
    document = "\n".join([*lines, "b" + ".a" * dots + " = 1"])
    tomllib.loads(document)
    assert has_endless_key(document) == (dots > MAX_DEPTH)
