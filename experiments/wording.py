"""The texts of a study: their languages, unfilled placeholders, what consent says of flicker, time, pay."""

import re
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, get_args

from pydantic import BaseModel

from experiments.assignment.order import motion_checks_by_block
from experiments.declaration.base import Translated
from experiments.declaration.experiment import Experiment

# The languages of declared texts: each has at least the study's first language, which is the fallback.

Text = tuple[str, dict[str, str]]
"""Dotted path of a declared text (list items count from 1), and the text by language."""


def language_fault(declared: BaseModel, languages: Sequence[str]) -> str | None:
    """What is wrong with the first text that lacks the first of `languages`, or None."""
    first, missing = languages[0], [text for text in _texts(declared) if languages[0] not in text[1]]
    if not missing:
        return None
    path, text = missing[0]
    undeclared = [language for language in text if language not in languages]
    has = f"only {', '.join(text)}" if text else "an empty table"
    unlisted = f", and languages does not list {', '.join(undeclared)}" if undeclared else ""
    others = f" ({len(missing) - 1} more lack it)" if len(missing) > 1 else ""
    return (
        f"{path}: expected a text in {first}, the first of languages, got {has}{unlisted}; add {first} to "
        f"the text, or correct languages{others}"
    )


def unlisted(declared: BaseModel, languages: Sequence[str]) -> str:
    """A sentence about texts that nobody sees because their language is not listed; empty if there are
    none."""
    texts = list(_texts(declared))
    codes = {code: None for _, text in texts for code in text if code not in languages}
    if not codes:
        return ""
    path = next(path for path, text in texts if not codes.keys().isdisjoint(text))
    return (
        f"Texts in {', '.join(codes)} are never shown, such as that of {path}: languages lists only "
        f"{', '.join(languages)}."
    )


def _texts(declared: BaseModel, prefix: str = "") -> Iterator[Text]:
    """Every text that was written; default texts have only the languages of the page.

    A stored declaration includes its defaults: a text equal to its default counts as not written.
    """
    for key, field in type(declared).model_fields.items():
        value = getattr(declared, key)
        if key in declared.model_fields_set and value != field.get_default(call_default_factory=True):
            yield from _texts_within(value, f"{prefix}{key}", is_translated(field.annotation))


def _texts_within(value: Any, path: str, is_text: bool) -> Iterator[Text]:
    if isinstance(value, BaseModel):
        yield from _texts(value, f"{path}.")
    elif isinstance(value, tuple):
        for number, item in enumerate(value, start=1):
            yield from _texts_within(item, f"{path}.{number}", is_text)
    elif is_text and isinstance(value, dict):
        yield path, value


def is_translated(annotation: Any) -> bool:
    """True if a key of this type holds a text in several languages."""
    return annotation == Translated or any(map(is_translated, get_args(annotation)))


# Whether consent mentions flicker. Some people are sensitive to it and must know before they consent.

WORDS = {
    "ar": r"وميض|وماض|تومض|يومض|تخفق|صرع",
    "de": r"flacker|flicker|flimmer|blitz|photosens|fotosens|lichtempfindlich|epilep",
    "en": r"flicker|flash|strob|photosens|epilep",
    "es": r"destell|titil|centelle|parpade(?:an|antes)|fotosens|epilep|epilép",
    "fr": r"scintill|clignot|papillot|vacill|photosens|épilep",
    "it": r"sfarfall|lampegg|tremol|intermitten|fotosens|epiless|epilett",
    "ja": r"ちらつ|点滅|明滅|フリッカ|フラッシュ|光過敏|光感受性|てんかん",
    "nl": r"flikker|flits|fotosens|lichtgevoelig|epilep",
    "pl": r"migot|migoc|migaj|błysk|fotosens|światłoczu|wrażliw\w* na światło|epilep|padacz",
    "pt": r"cintil|tremel|bruxule|tremul|lampej|piscantes|fotossens|epilep|epilép",
    "zh": r"闪烁|闪光|闪动|频闪|光敏|癫痫|閃爍|閃光|癲癇",
}
"""Parts of words with which a consent text mentions flicker, per page language; none is about blinking."""
SENTENCES = {
    "ar": "تعرض بعض المقاطع القصيرة نقاطًا تومض بسرعة.",
    "de": "Einige kurze Clips zeigen flimmernde Punkte.",
    "en": "A few short clips show flickering dots.",
    "es": "Algunos clips breves muestran puntos que titilan.",
    "fr": "Quelques courts clips montrent des points qui scintillent.",
    "it": "Alcune brevi clip mostrano punti che sfarfallano.",
    "ja": "いくつかの短い映像では、点がちらつきます。",
    "nl": "Enkele korte clips tonen flikkerende stippen.",
    "pl": "Niektóre krótkie klipy pokazują migoczące kropki.",
    "pt": "Alguns clipes curtos mostram pontos que cintilam.",
    "zh": "部分短片会显示闪烁的圆点。",
}
"""A sentence for a consent text; only English is reviewed, the others await review."""


def mentions_flicker(text: str, language: str) -> bool:
    """Whether a text mentions flicker; True in languages whose words are unknown."""
    known = WORDS.get(language.partition("-")[0].lower())
    return known is None or re.search(known, text, re.IGNORECASE) is not None


def silent_on_flicker(experiment: Experiment) -> list[str]:
    """Languages of a study with motion checks of dots whose consent does not mention flicker."""
    if not any(motion_checks_by_block(experiment)):
        return []
    if all(kind.startswith("first_") for kind in experiment.evidence.motion_checks.kinds):
        return []
    return [
        language
        for language in experiment.languages
        if not mentions_flicker(experiment.texts[language].consent, language)
    ]


def suggested_sentence(language: str) -> str:
    """A sentence that a consent text in this language can use."""
    return SENTENCES.get(language.partition("-")[0].lower(), SENTENCES["en"])


# Unfilled placeholders in the texts that participants read.
#
# Templates of consent forms have marks such as `[Title]` and `[name, institution, e-mail]`. A text that still
# has one must not reach participants.

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
"""Bracketed text that is not a placeholder: a key to press, one character, a number, `[sic]`."""
_ASIDES = re.compile(
    r"optional|required|mandatory|(?:please )?(?:specify|explain|describe)|freiwillig|"
    r"pflicht(?:feld|angabe)?|"
    r"erforderlich|bitte (?:angeben|nennen|erläutern)|facultati[fv]e?|obligatoire|(?:veuillez )?préciser|"
    r"opcional|obligatorio|obrigatório|especifi(?:car|que)|facoltativo|obbligatorio|specificare|optioneel|"
    r"verplicht|opcjonalne|wymagane|任意|必須|可选|选填|必填|e\.g\..*|i\.e\..*|z\. ?B\..*|"
    r"[^\W\d_].*\b(?:19|20)\d\d[a-z]?",
    re.IGNORECASE,
)
"""Bracketed text for people: that an answer is optional, to specify it, examples, sources by year."""
MAX_MARKS_NAMED = 5


class UnfilledText(NamedTuple):
    """One text in one language with unfilled marks.

    Attributes
    ----------
    path : str
        As the TOML has it, with the language: `texts.en.consent`.
    where : str
        The same in the words of the pages: `the text "Consent"`.
    certain : bool
        False if the marks may be intended.
    """

    path: str
    where: str
    language: str
    marks: tuple[str, ...]
    certain: bool

    def __str__(self) -> str:
        named = ", ".join(self.marks[:MAX_MARKS_NAMED])
        more = len(self.marks) - MAX_MARKS_NAMED
        rest = f" and {more} more" if more > 0 else ""
        one = len(self.marks) == 1
        if not self.certain:
            of = f"{_capitalized(self.where)} (language {self.language})"
            return f"{of} has {named}{rest}. Should this be filled in before participants read it?"
        return (
            f"{_capitalized(self.where)} (language {self.language}) still has "
            f"{'a placeholder' if one else 'placeholders'} to fill in: {named}{rest}. Replace "
            f"{'it' if one else 'each'}, or put `backticks` around {'it' if one else 'one'} that "
            "participants should read unchanged."
        )


def unfilled_texts(declared: Experiment) -> list[UnfilledText]:
    """The texts with placeholders, in the languages that participants are offered; certain ones first."""
    texts = []
    for path, language, text in participant_texts(declared):
        if language not in declared.languages:
            continue
        plain = _LINK.sub(" ", _CODE.sub(" ", text))
        if path.startswith("attention.text"):
            plain = plain.replace("{response}", " ")  # the page fills it in
        where = place_in_words(declared, path)
        if certain := tuple(dict.fromkeys(_certain(plain))):
            texts.append(UnfilledText(path, where, language, certain, certain=True))
        elif doubtful := tuple(dict.fromkeys(_DOUBTFUL.findall(_RULE.sub(" ", plain)))):
            texts.append(UnfilledText(path, where, language, doubtful, certain=False))
    return sorted(texts, key=lambda text: not text.certain)


def _certain(text: str) -> Iterator[str]:
    for match in _BRACKETS.finditer(text):
        inside = match[1].strip()
        if any(map(str.isalpha, inside)) and not (_KEYS.fullmatch(inside) or _ASIDES.fullmatch(inside)):
            yield match[0]
    for pattern in (_BRACES, _WORDS):
        yield from pattern.findall(text)


_NOUNS = {
    "factors": "factor",
    "levels": "level",
    "forms": "questionnaire",
    "fields": "question",
    "options": "answer",
    "scales": "scale",
}


def place_in_words(declared: Experiment, path: str) -> str:
    """The place of a text as the builder calls it: `"Label" of the question age of the questionnaire about`.

    >>> place_in_words(Experiment.model_construct(), "texts.en.block_break")
    'the text "Block break"'
    """
    first, *rest = path.split(".")
    if first == "texts":
        return f'the text "{_label_of(rest[-1])}"'
    places: list[str] = []
    value: Any = declared
    key = ""
    for part in path.split("."):
        if isinstance(value, tuple):
            value = value[int(part) - 1]
            name = getattr(value, "name", "") or getattr(value, "value", "") or part
            places[-1] = f"the {_NOUNS[key]} {name}" if key in _NOUNS else f'"{_label_of(key)}" {part}'
        elif isinstance(value, BaseModel):
            value, key = getattr(value, part), part
            places.append(f'"{_label_of(part)}"')
    return " of ".join(reversed(places))


def _label_of(key: str) -> str:
    """How the builder labels a key: `block_break` is "Block break"."""
    return _capitalized(key.replace("_", " "))


def _capitalized(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}"


class ParticipantText(NamedTuple):
    """A text that participants read, in one language."""

    path: str
    language: str
    text: str


def participant_texts(declared: Experiment) -> Iterator[ParticipantText]:
    """Every page and every translated text, and the title if participants read it."""
    if not declared.participant_title:
        yield from (ParticipantText("title", language, declared.title) for language in declared.languages[:1])
    for language, pages in declared.texts.items():
        for name in type(pages).model_fields:
            yield ParticipantText(f"texts.{language}.{name}", language, getattr(pages, name))
    for path, text in translated_texts(declared):
        yield from (ParticipantText(f"{path}.{code}", code, words) for code, words in text.items())


def translated_texts(declared: BaseModel, prefix: str = "") -> Iterator[tuple[str, dict[str, str]]]:
    """Dotted path of each translated text (list items count from 1), and the text by language."""
    for key, field in type(declared).model_fields.items():
        yield from _placeholders_within(
            getattr(declared, key), f"{prefix}{key}", is_translated(field.annotation)
        )


def _placeholders_within(value: Any, path: str, is_text: bool) -> Iterator[tuple[str, dict[str, str]]]:
    if isinstance(value, BaseModel):
        yield from translated_texts(value, f"{path}.")
    elif isinstance(value, tuple):
        for number, item in enumerate(value, start=1):
            yield from _placeholders_within(item, f"{path}.{number}", is_text)
    elif is_text and isinstance(value, dict):
        yield path, value


def untranslated(declared: Experiment) -> dict[str, list[str]]:
    """Language -> paths of texts that its participants see in the study's first language."""
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


# What a consent text promises: whom to contact, how long it takes, what is paid.

_CONTACT = re.compile(r"[^\s@<>]+@[^\s@<>]+\.\w{2,}|https?://\S+|\+?\d[\d ()/-]{6,}\d")
_UNITS = {
    "en": "one two three four five six seven eight nine ten eleven twelve thirteen fourteen fifteen sixteen "
    "seventeen eighteen nineteen",
    "de": "ein zwei drei vier fünf sechs sieben acht neun zehn elf zwölf dreizehn vierzehn fünfzehn sechzehn "
    "siebzehn achtzehn neunzehn",
}
_TENS = {
    "en": ("twenty thirty forty fifty sixty seventy eighty ninety", "{tens}-{unit}"),
    "de": ("zwanzig dreißig vierzig fünfzig sechzig siebzig achtzig neunzig", "{unit}und{tens}"),
}


def _spelled_numbers() -> dict[str, int]:
    """Numbers below 100 that a text may spell out."""
    numbers = {"eine": 1}
    for language, (every_ten, both) in _TENS.items():
        units = _UNITS[language].split()
        numbers |= {word: number for number, word in enumerate(units, 1)}
        for ten, tens in enumerate(every_ten.split(), 2):
            numbers[tens] = 10 * ten
            for unit, word in enumerate(units[:9], 1):
                numbers[both.format(tens=tens, unit=word)] = 10 * ten + unit
    return numbers


_SPELLED = _spelled_numbers()
# The longest first, else the "five" of "twenty five" would be a number by itself.
_SPELLED_WORDS = "|".join(sorted(_SPELLED, key=len, reverse=True)).replace("-", r"[-\s]")
_NUMBER = rf"(\d+|\b(?:{_SPELLED_WORDS})\b)"
_MINUTES = re.compile(
    rf"{_NUMBER}(?:\s*(?:-|–|to|bis|à|a|do|tot)\s*{_NUMBER})?\s*(?:min(?:ut)?\w*\b|分)", re.IGNORECASE
)
_SIGNS = {"£": "£", "gbp": "£", "pound": "£", "$": "$", "usd": "$", "dollar": "$"} | {
    "€": "€", "eur": "€", "euro": "€"
}  # fmt: skip
_UNIT = r"(£|\$|€|GBP|USD|EUR|pound|dollar|euro)"
_PAY = re.compile(rf"{_UNIT}\s?(\d+(?:[.,]\d{{1,2}})?)|(\d+(?:[.,]\d{{1,2}})?)\s?{_UNIT}s?\b", re.IGNORECASE)
_PAY_SIGN_LAST = re.compile(r"(\d+(?:[.,]\d{1,2})?)\s?([£$€])")
_HOURLY = re.compile(
    r"^\s*(?:per hour|an hour|/ ?h\b|/ ?hour|pro stunde|/ ?stunde|par heure|por hora)", re.IGNORECASE
)
LEAST_HOURLY_PAY = {"£": 6.0, "$": 8.0, "€": 7.0}
"""Below this, recruiters such as Prolific refuse a study (its minimum of 2024: £6 or $8 an hour)."""
MINUTES_TOLERANCE = 1.5
"""A stated time is wrong if it differs from the expected time by more than this factor."""


class StatedPay(NamedTuple):
    """An amount of money in a text.

    Attributes
    ----------
    sign : str
        Of the currency: "£", "$" or "€".
    hourly : bool
        Whether the text says that it is paid per hour.
    """

    amount: float
    sign: str
    hourly: bool


def silent_on_contact(experiment: Experiment) -> list[str]:
    """Languages whose consent has no e-mail address, telephone number or web address."""
    return [one for one in experiment.languages if not _CONTACT.search(experiment.texts[one].consent)]


def stated_minutes(text: str) -> int | None:
    """The longest time in minutes that a text mentions; None if it mentions none.

    >>> stated_minutes("10 to 15 minutes."), stated_minutes("Dauer: 20 Minuten"), stated_minutes("short")
    (15, 20, None)
    >>> stated_minutes("It takes about two minutes."), stated_minutes("zehn bis fünfzehn Minuten")
    (2, 15)
    >>> stated_minutes("forty-five minutes"), stated_minutes("twenty five to thirty minutes")
    (45, 30)
    >>> stated_minutes("fünfundzwanzig Minuten"), stated_minutes("five-ten minutes")
    (25, 10)
    """
    spelled = [number for match in _MINUTES.finditer(text) for number in match.groups() if number]
    minutes = [_SPELLED.get("-".join(number.lower().split())) or int(number) for number in spelled]
    return max(minutes, default=None)


def stated_pay(text: str) -> StatedPay | None:
    """The first amount of money that a text mentions; None if it mentions none.

    >>> stated_pay("You receive £2.50."), stated_pay("Sie erhalten 12 € pro Stunde")
    (StatedPay(amount=2.5, sign='£', hourly=False), StatedPay(amount=12.0, sign='€', hourly=True))
    """
    matches = [match for pattern in (_PAY, _PAY_SIGN_LAST) if (match := pattern.search(text))]
    if not matches:
        return None
    match = min(matches, key=lambda one: one.start())
    parts = [part for part in match.groups() if part]
    number = next(part for part in parts if part[0].isdigit())
    unit = next(part for part in parts if not part[0].isdigit())
    hourly = _HOURLY.match(text[match.end() :]) is not None
    return StatedPay(float(number.replace(",", ".")), _SIGNS[unit.lower()], hourly)
