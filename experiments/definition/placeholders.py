"""Placeholders that nobody has filled in, in the texts that participants read.

Templates of consent forms have marks such as `[Title]` and `[name, institution, e-mail]`. A text that still
has one must not reach participants.
"""

import re
from collections.abc import Iterator
from typing import Any, NamedTuple

from pydantic import BaseModel

from experiments.definition.experiment import Experiment
from experiments.definition.languages import is_translated

_CODE = re.compile(r"`[^`\n]*`")
_LINK = re.compile(r"\[[^\[\]\n]*\](?:\([^)\s]+\)|\[[^\[\]\n]*\])|<(?:https?|mailto):[^>\s]*>")
_BRACKETS = re.compile(r"[\[［]([^\[\]［］\n]{1,80})[\]］]")
_BRACES = re.compile(r"\{\{[^{}\n]{1,80}\}\}|\$\{[^{}\n]{1,80}\}|<<[^<>\n]{1,80}>>")
_WORDS = re.compile(r"\b(?:TODO|TBD|TBC|FIXME|XXX+|[Ll]orem ipsum)\b")
_DOUBTFUL = re.compile(r"(?<![{$])\{[^\W\d_][^{}\n]{0,60}\}|<[^\W\d_][^<>@:/\n]{0,60}>|\bXX\b|_{3,}|\?{3,}")
_RULE = re.compile(r"^\s{0,3}_(\s*_){2,}\s*$", re.MULTILINE)
_KEYS = re.compile(
    r"(?:the )?(?:space(?: ?bar)?|enter|return|escape|esc|shift|tab|ctrl|control|alt|delete|backspace|"
    r"left|right|up|down|page (?:up|down)|home|end|f\d{1,2}|leertaste|eingabe(?:taste)?|umschalt|strg|"
    r"links|rechts|oben|unten|sic|…|\.\.\.|[^\W_]|\d[\d\s,.:%–-]*)",
    re.IGNORECASE,
)
"""What stands in brackets without being a placeholder: a key to press, one character, a number, `[sic]`."""
_ASIDES = re.compile(
    r"optional|required|mandatory|(?:please )?(?:specify|explain|describe)|freiwillig|"
    r"pflicht(?:feld|angabe)?|"
    r"erforderlich|bitte (?:angeben|nennen|erläutern)|facultati[fv]e?|obligatoire|(?:veuillez )?préciser|"
    r"opcional|obligatorio|obrigatório|especifi(?:car|que)|facoltativo|obbligatorio|specificare|optioneel|"
    r"verplicht|opcjonalne|wymagane|任意|必須|可选|选填|必填|e\.g\..*|i\.e\..*|z\. ?B\..*|"
    r"[^\W\d_].*\b(?:19|20)\d\d[a-z]?",
    re.IGNORECASE,
)
"""What brackets say to people: that an answer is optional, to specify it, examples, sources by year."""
MAX_MARKS_NAMED = 5


class Unfilled(NamedTuple):
    """One text in one language with marks that nobody has filled in.

    Attributes
    ----------
    path : str
        As the TOML has it, with the language: `texts.en.consent`.
    certain : bool
        False where the marks may be meant as they are.
    """

    path: str
    language: str
    marks: tuple[str, ...]
    certain: bool

    def __str__(self) -> str:
        named = ", ".join(self.marks[:MAX_MARKS_NAMED])
        more = len(self.marks) - MAX_MARKS_NAMED
        rest = f" and {more} more" if more > 0 else ""
        one = len(self.marks) == 1
        if not self.certain:
            of = f"{self.path} (language {self.language})"
            return f"{of} has {named}{rest}. Should this be filled in before participants read it?"
        return (
            f"{self.path} (language {self.language}) still has {'a placeholder' if one else 'placeholders'} "
            f"that nobody filled in: {named}{rest}. Replace {'it' if one else 'each'}, or put `backticks` "
            f"around {'it' if one else 'one'} that participants are to read as it is."
        )


def unfilled(declared: Experiment) -> list[Unfilled]:
    """The texts with placeholders, in the languages that participants are offered; certain ones first."""
    texts = []
    for path, language, text in participant_texts(declared):
        if language not in declared.languages:
            continue
        plain = _LINK.sub(" ", _CODE.sub(" ", text))
        if path.startswith("attention.text"):
            plain = plain.replace("{response}", " ")  # the page fills it in
        if certain := tuple(dict.fromkeys(_certain(plain))):
            texts.append(Unfilled(path, language, certain, certain=True))
        elif doubtful := tuple(dict.fromkeys(_DOUBTFUL.findall(_RULE.sub(" ", plain)))):
            texts.append(Unfilled(path, language, doubtful, certain=False))
    return sorted(texts, key=lambda text: not text.certain)


def _certain(text: str) -> Iterator[str]:
    for match in _BRACKETS.finditer(text):
        inside = match[1].strip()
        if any(map(str.isalpha, inside)) and not (_KEYS.fullmatch(inside) or _ASIDES.fullmatch(inside)):
            yield match[0]
    for pattern in (_BRACES, _WORDS):
        yield from pattern.findall(text)


class ParticipantText(NamedTuple):
    """A text that participants read, in one language."""

    path: str
    language: str
    text: str


def participant_texts(declared: Experiment) -> Iterator[ParticipantText]:
    """Every page and every translated text, and the title where participants read it."""
    if not declared.participant_title:
        yield from (ParticipantText("title", language, declared.title) for language in declared.languages[:1])
    for language, pages in declared.texts.items():
        for name in type(pages).model_fields:
            yield ParticipantText(f"texts.{language}.{name}", language, getattr(pages, name))
    for path, text in translated_texts(declared):
        yield from (ParticipantText(f"{path}.{code}", code, words) for code, words in text.items())


def translated_texts(declared: BaseModel, prefix: str = "") -> Iterator[tuple[str, dict[str, str]]]:
    """Dotted path of each text that has translations (items of lists from 1), and the text by language."""
    for key, field in type(declared).model_fields.items():
        yield from _within(getattr(declared, key), f"{prefix}{key}", is_translated(field.annotation))


def _within(value: Any, path: str, is_text: bool) -> Iterator[tuple[str, dict[str, str]]]:
    if isinstance(value, BaseModel):
        yield from translated_texts(value, f"{path}.")
    elif isinstance(value, tuple):
        for number, item in enumerate(value, start=1):
            yield from _within(item, f"{path}.{number}", is_text)
    elif is_text and isinstance(value, dict):
        yield path, value


def untranslated(declared: Experiment) -> dict[str, list[str]]:
    """Language -> paths of texts that participants who read it get in the study's first language."""
    first, *others = declared.languages
    missing: dict[str, list[str]] = {}
    written = [(path, text) for path, text in translated_texts(declared) if text.get(first)]
    for language in others:
        pages, first_pages = declared.texts[language], declared.texts[first]
        empty = [
            f"texts.{language}.{name}"
            for name in type(pages).model_fields
            if getattr(first_pages, name).strip() and not getattr(pages, name).strip()
        ]
        lacking = [*empty, *(path for path, text in written if not text.get(language))]
        if lacking:
            missing[language] = lacking
    return missing
