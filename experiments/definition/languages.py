"""The languages of declared texts: each has at least the study's first, which participants fall back on."""

from collections.abc import Iterator, Sequence
from typing import Any, get_args

from pydantic import BaseModel

from experiments.base import Translated

Text = tuple[str, dict[str, str]]
"""Dotted path of a declared text, items of lists from 1, and the text by language."""


def fault(declared: BaseModel, languages: Sequence[str]) -> str | None:
    """What is wrong with the first text that lacks the first of `languages`, or None."""
    first, missing = languages[0], [text for text in _texts(declared) if languages[0] not in text[1]]
    if not missing:
        return None
    path, text = missing[0]
    undeclared = [language for language in text if language not in languages]
    has = f"one in {', '.join(text)} alone" if text else "an empty table"
    unlisted = f", and languages does not list {', '.join(undeclared)}" if undeclared else ""
    others = f" ({len(missing) - 1} more lack it)" if len(missing) > 1 else ""
    return (
        f"{path}: expected a text in {first}, the first of languages, got {has}{unlisted}; add {first} to "
        f"the text, or correct languages{others}"
    )


def unlisted(declared: BaseModel, languages: Sequence[str]) -> str:
    """A sentence on texts that nobody is offered, since their language is not listed; empty where none is."""
    texts = list(_texts(declared))
    codes = {code: None for _, text in texts for code in text if code not in languages}
    if not codes:
        return ""
    path = next(path for path, text in texts if not codes.keys().isdisjoint(text))
    return (
        f"Texts in {', '.join(codes)} are offered to nobody, such as that of {path}: languages lists "
        f"{', '.join(languages)} alone."
    )


def _texts(declared: BaseModel, prefix: str = "") -> Iterator[Text]:
    """Every text that was written; those by default have the languages of the page and no others.

    A stored declaration holds its defaults too: what is as by default counts as not written.
    """
    for key, field in type(declared).model_fields.items():
        value = getattr(declared, key)
        if key in declared.model_fields_set and value != field.get_default(call_default_factory=True):
            yield from _within(value, f"{prefix}{key}", is_translated(field.annotation))


def _within(value: Any, path: str, is_text: bool) -> Iterator[Text]:
    if isinstance(value, BaseModel):
        yield from _texts(value, f"{path}.")
    elif isinstance(value, tuple):
        for number, item in enumerate(value, start=1):
            yield from _within(item, f"{path}.{number}", is_text)
    elif is_text and isinstance(value, dict):
        yield path, value


def is_translated(annotation: Any) -> bool:
    """True where a key of this type holds a text in several languages."""
    return annotation == Translated or any(map(is_translated, get_args(annotation)))
