"""Patterns of file names against what a regular expression makes of them, where that ends."""

import re
import time

from hypothesis import given
from hypothesis import strategies as st

from experiments.own_clips import FIELD, NamePattern

TEXT = st.sampled_from(["", "_", "a", "_a", "aa", "."])


def by_regular_expression(pattern: str, name: str) -> dict[str, str] | None:
    escaped = re.escape(pattern)
    for field in FIELD.findall(pattern):
        escaped = escaped.replace(re.escape("{" + field + "}"), f"(?P<{field}>[^/]+?)", 1)
    fit = re.fullmatch(escaped, name)
    return fit.groupdict() if fit else None


@given(st.lists(TEXT, min_size=2, max_size=5), st.text("ab_./", max_size=10))
def test_a_field_is_what_a_regular_expression_finds(texts: list[str], name: str) -> None:
    pattern = texts[0] + "".join(f"{{f{number}}}{text}" for number, text in enumerate(texts[1:]))
    fit = NamePattern.read(pattern).fit(name)
    assert (None if fit is None else dict(fit)) == by_regular_expression(pattern, name)


def test_many_fields_take_no_time() -> None:
    pattern = "".join(f"{{f{number}}}" for number in range(30))
    began = time.process_time()
    assert NamePattern.read(pattern + "!").fit("a" * 255) is None
    assert NamePattern.read(pattern).fit("a" * 255) is not None
    assert time.process_time() - began < 10  # for ever as a regular expression
