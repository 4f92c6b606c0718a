import time
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.load import line_of

TEXT = '''\
title = "one # not a comment"   # a [comment] = 2
text = """
title = "no key of the document"
[trial]
kind = "neither"
He said \\""" and "" and more""""
raw = \'\'\'
[[forms]]
name = "no form"
\'\'\'
rows = [
    ["a", "b"],
    [ "c" ],
]
names = ["[x]", "{"]
[trial]
kind = "clip_rating"
question = { en = "a [b] = c" }
[[forms]]
name = "first"
[[forms]]
name = "second"
'''


@pytest.mark.parametrize(
    ("location", "line"),
    [
        (("title",), 1),
        (("text",), 2),
        (("raw",), 7),
        (("rows",), 11),
        (("rows", 1, 0), 11),
        (("names",), 15),
        (("trial",), 16),
        (("trial", "kind"), 17),
        (("trial", "question", "en"), 18),
        (("forms", 0, "name"), 20),
        (("forms", 1, "name"), 22),
        (("forms", 1), 21),
        (("absent",), None),
    ],
)
def test_a_key_is_found_on_its_own_line(location: tuple[object, ...], line: int | None) -> None:
    tomllib.loads(TEXT)
    assert line_of(TEXT, location) == line


words = st.text(alphabet="ab\"'[]{}=#\\ \n", max_size=30)


@given(st.lists(words, min_size=1, max_size=4))
def test_whatever_is_in_texts_the_keys_after_them_are_found(texts: list[str]) -> None:
    lines: list[str] = []
    expected = {}
    for number, text in enumerate(texts):
        escaped = text.replace("\\", "\\\\").replace('"', '\\"')
        expected[f"key{number}"] = sum(line.count("\n") + 1 for line in lines) + 1
        lines.append(f'key{number} = """{escaped}"""')
    document = "\n".join(lines)
    tomllib.loads(document)
    assert {key: line_of(document, (key,)) for key in expected} == expected


def test_spaced_and_quoted_parts_of_a_header_are_distinguished() -> None:
    text = '[ a . "b.c" . \'d.e\' ]\nf = 1\n[[ "g.h" ]]\ni . j = 1\n'
    tomllib.loads(text)
    assert line_of(text, ("a", "b.c", "d.e", "f")) == 2
    assert line_of(text, ("g.h", 0)) == 3


def test_a_header_that_is_all_spaces_is_reported_at_once() -> None:
    text, began = f'["a{" " * 100_000}b"]\nc = 1\n', time.process_time()
    assert line_of(text, ("c",)) is None
    assert line_of(text, (f"a{' ' * 100_000}b", "c")) == 2
    assert time.process_time() - began < 5.0  # tried from each space anew, 15 s
