"""Which cell each of your own clips belongs to: by a table of levels, or by a pattern of file names."""

import math
import re
import unicodedata
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import count, islice, product
from math import prod
from pathlib import PurePosixPath

from experiments.errors import InputError, did_you_mean
from experiments.kinds import reserved_names
from table_files.delimited import NamedRows, table_of_text

# Patterns of file names such as `{character}_{speed}.mp4`: the text in the place of each field.
#
# As a regular expression, such a pattern takes time that grows as a power of the length of the name, with one
# power per field. A few fields and one long name that does not match kept a server busy for minutes. Here,
# each position of a name is examined once per field.

FIELD = re.compile(r"\{([A-Za-z][A-Za-z0-9_]*)\}")


@dataclass(frozen=True)
class NamePattern:
    """Texts and, between them, fields of at least one character without a slash, each as short as
    possible.

    Attributes
    ----------
    texts : tuple of str
        One more than fields.
    fields : tuple of str
    """

    texts: tuple[str, ...]
    fields: tuple[str, ...]

    @classmethod
    def read(cls, pattern: str) -> "NamePattern":
        """The pattern in a text."""
        parts = FIELD.split(pattern)
        return cls(tuple(parts[::2]), tuple(parts[1::2]))

    def fit(self, name: str) -> Mapping[str, str] | None:
        """The text for each field in a whole name; None if the name does not match the pattern.

        >>> NamePattern.read("{face}_{speed}.mp4").fit("ada_slow.mp4")
        {'face': 'ada', 'speed': 'slow'}
        >>> NamePattern.read("{face}_{speed}.mp4").fit("ada.mp4")
        """
        if not name.startswith(self.texts[0]):
            return None
        # For each field, possible start positions that led nowhere.
        dead: list[set[int]] = [set() for _ in self.fields]
        begins, ends = [len(self.texts[0])], list[int]()
        while len(ends) < len(self.fields):
            number = len(begins) - 1
            end = self._next_end(name, number, begins[-1], ends_after=begins[-1], dead=dead)
            while end is None:
                dead[number].add(begins.pop())
                if not begins:
                    return None
                number -= 1
                end = self._next_end(name, number, begins[-1], ends_after=ends.pop(), dead=dead)
            ends.append(end)
            begins.append(end + len(self.texts[number + 1]))
        return {field: name[begin:end] for field, begin, end in zip(self.fields, begins, ends, strict=False)}

    def _next_end(
        self, name: str, number: int, begin: int, ends_after: int, dead: list[set[int]]
    ) -> int | None:
        """The next possible end of a field for which the rest is not known to fail."""
        text, is_last = self.texts[number + 1], number + 1 == len(self.fields)
        slash = name.find("/", begin)
        limit = len(name) if slash < 0 else slash
        if is_last:
            end = len(name) - len(text)
            return end if ends_after < end <= limit and name.endswith(text) else None
        end = name.find(text, ends_after + 1) if text else ends_after + 1
        while 0 <= end <= limit and end < len(name):
            if end + len(text) not in dead[number + 1]:
                return end
            end = name.find(text, end + 1) if text else end + 1
        return None


# Suggested names of factors, based on the parts of file names.

WORDS = {
    "speed": "slow slower slowest medium middle normal fast faster fastest quick",
    "emotion": "happy sad angry anger afraid fear fearful neutral disgust surprise joy",
    "gender": "female male woman man women men girl boy nonbinary",
    "age": "young middleaged old adult child",
    "side": "left right centre center",
    "direction": "up down upward downward upwards downwards forward forwards backward backwards",
    "size": "tiny small medium large big huge",
    "height": "low mid high",
    "colour": "red green blue yellow black white grey gray orange purple brown pink",
    "agent": "human robot android avatar person agent",
    "condition": "control treatment baseline experimental",
    "system": "ours baseline proposed mocap gt groundtruth reference natural ablation previous handmade",
    "presence": "on off with without yes no present absent",
    "quality": "original compressed reference impaired",
    "profile": "real model",
}  # fmt: skip
"""Names of factors, each with words that its levels often are; the first that has all of them is taken."""
TAKES = ("exemplar", "ex", "take", "rep", "clip", "no", "nr", "n", "v", "version", "item", "trial")
"""Words that number clips of the same kind."""
_KEYED = re.compile(r"([A-Za-z][A-Za-z0-9]*)([-=])(.+)")
_NUMBERED = re.compile(r"([A-Za-z]+)()(\d+(?:[.p]\d+)?)")
_WITH_UNIT = re.compile(r"(.*\d)(ms|s|fps|hz|px|mm|cm|deg|db|percent)", re.IGNORECASE)


def name_and_frame(parts: Sequence[str]) -> tuple[str | None, str, str]:
    """A name for a factor based on its levels, and the constant text before and after each of them.

    Parameters
    ----------
    parts : sequence of str
        The parts of file names in one place, such as `speed-slow` and `speed-fast`, or `slow` and `fast`.

    Returns
    -------
    str or None
        The name; None if the parts do not suggest one.
    str
        The start of each part that does not belong to the level, such as `speed-`.
    str
        The end of each part that does not belong to the level, such as the unit of `dur60ms`.
    """
    name, head = _name_and_head(parts)
    tails = {fit[2] if (fit := _WITH_UNIT.fullmatch(part)) else "" for part in parts}
    if name is None and len(tails) == 1 and (tail := tails.pop()):
        name, head = _name_and_head([part.removesuffix(tail) for part in parts])
        if name is not None:
            return name, head, tail
    return name, head, ""


def _name_and_head(parts: Sequence[str]) -> tuple[str | None, str]:
    for form in (_KEYED, _NUMBERED):
        fits = [form.fullmatch(part) for part in parts]
        heads = {fit[1] + fit[2] for fit in fits if fit is not None}
        if None not in fits and len(heads) == 1:
            head = heads.pop()
            name = head.rstrip("-=").lower()
            return (name if _free(name) else None), head
    words = {re.sub(r"[^a-z]", "", part.lower()) for part in parts}
    guessed = (name for name, levels in WORDS.items() if words <= set(levels.split()))
    return next((name for name in guessed if _free(name)), None), ""


def _free(name: str) -> bool:
    return name not in reserved_names()


# The order of levels from file names: numbers by size, words of known scales by position.

SCALES = tuple(
    {word: rank for rank, word in enumerate(words.split())}
    for words in (
        "verylow lowest lower low mid medium middle moderate normal average high higher highest veryhigh",
        "veryslow slowest slower slow medium middle moderate normal average quick fast quicker faster "
        "quickest fastest veryfast",
        "tiny verysmall smallest smaller small medium middle normal average big large bigger "
        "larger biggest largest huge verylarge",
        "xs s m l xl xxl",
        "min medium mid max",
        "minimum medium middle maximum",
        "subtle slight weak mild light medium moderate strong severe extreme",
        "veryshort shortest shorter short medium middle normal average long longer longest verylong",
        "few some several many most all",
        "little some half much full",
        "partial half full complete",
        "never rarely seldom sometimes occasionally often usually always",
        "terrible bad poor fair okay good excellent perfect",
        "freezing cold cool lukewarm warm hot",
        "silent quiet soft medium normal loud",
        "dark dim medium normal bright",
        "baby child adolescent teen young adult middleaged old elderly",
        "before during after",
        "pre mid post",
        "first second third fourth fifth sixth last",
        "control treatment",
        "left center centre middle right",
        "no yes",
        "off on",
        "false true",
        "without with",
        "absent present",
    )
)
"""Words of common scales in their order."""
LEAST = {"none", "zero", "nothing", "baseline"}
"""Words that begin a scale."""
_NUMBERED_LEVEL = re.compile(r"((?:[^\d+-]\D*)?)([+-]?\d+(?:\.\d+)?)(\D*)")


def in_order(levels: Sequence[str]) -> list[str]:
    """The different levels in the order of tables and contrasts.

    Parameters
    ----------
    levels : sequence of str
        As files or the rows of a table have them, repeated.

    Returns
    -------
    list of str
        By size if all are numbers, or a number between the same words (`2ms`, `10ms`). By position if all are
        words of one scale (`slow`, `medium`, `fast`). Otherwise in their original order.
    """
    different = list(dict.fromkeys(levels))
    for places in (_numbers(different), _places(different)):
        if places is not None:
            return [
                level for _, level in sorted(zip(places, different, strict=True), key=lambda pair: pair[0])
            ]
    return different


def _numbers(levels: Sequence[str]) -> list[float] | None:
    """The number of each level; None unless all have the same words around it."""
    try:
        numbers = [float(level) for level in levels]
    except ValueError:
        fits = [fit for level in levels if (fit := _NUMBERED_LEVEL.fullmatch(level)) is not None]
        alike = len(fits) == len(levels) and len({(fit[1], fit[3]) for fit in fits}) == 1
        return [float(fit[2]) for fit in fits] if alike else None
    return numbers if all(map(math.isfinite, numbers)) else None


def _places(levels: Sequence[str]) -> list[int] | None:
    """The position of each level in the first scale that contains them all; None if there is none."""
    words = [re.sub(r"[\W_]", "", level.casefold()) for level in levels]
    for scale in SCALES:
        if all(word in scale or word in LEAST for word in words) and any(word in scale for word in words):
            return [scale.get(word, -1) for word in words]
    return None


Placed = dict[str, tuple[dict[str, str], int]]
"""File name -> (levels by factor, exemplar)."""
FIRST_FIELD = "exemplar"
MAX_CELLS_NAMED = 3


def one_form(name: str) -> str:
    """A name in the Unicode form that equal-looking names share (NFC)."""
    return unicodedata.normalize("NFC", name)


def levels_from_table(text: str, files: Iterable[str]) -> Placed:
    """Read levels from CSV text: one row per clip, and a value for every level."""
    return levels_from_rows(table_of_text(text, "the table").named_rows(), files)


def levels_from_rows(table: NamedRows, files: Iterable[str]) -> Placed:
    """Read levels from a table as `levels_from_table` does."""
    columns = [name for name in table.header if name]
    if "file" not in columns or len(columns) < 2:
        raise InputError(
            f"expected a CSV with a column 'file' and one column per factor, got "
            f"{', '.join(columns) or 'none'}"
        )
    factors = [name for name in columns if name not in ("file", FIRST_FIELD)]
    refuse_reserved_factors(factors)
    known, rows = set(files), {}
    for number, row in table.rows:
        name = one_form((row["file"] or "").strip())
        if name not in known:
            raise InputError(
                f"line {number} of the table: no clip is called '{name}'{did_you_mean(name, known)}"
            )
        if name in rows:
            raise InputError(f"line {number} of the table: expected each clip once, got '{name}' twice")
        levels = {factor: (row[factor] or "").strip() for factor in factors}
        if empty := [factor for factor, level in levels.items() if not level]:
            raise InputError(f"line {number} of the table: '{name}' has no level for '{empty[0]}'")
        rows[name] = (levels, (row.get(FIRST_FIELD) or "").strip())
    if missing := sorted(known - set(rows)):
        raise InputError(
            f"{len(missing)} clips have no row in the table, such as '{missing[0]}'; add one row per clip"
        )
    return _numbered(rows)


def levels_from_names(pattern: str, files: Iterable[str]) -> Placed:
    """Read levels from file names by a pattern such as `{character}_{speed}_{exemplar}.mp4`."""
    fields = FIELD.findall(pattern)
    refuse_reserved_factors(fields)
    if not [name for name in fields if name != FIRST_FIELD] or len(set(fields)) != len(fields):
        raise InputError(
            "expected a pattern with each factor once in braces, such as {character}_{exemplar}.mp4"
        )
    whole, by_stem = (NamePattern.read(one_form(text)) for text in (pattern, _stem(pattern)))
    rows = {}
    for name in files:
        fit = by_stem.fit(_stem(name))  # files in several formats share one pattern
        if fit is None:
            fit = whole.fit(name)
        if fit is None:
            raise InputError(f"the file name '{name}' does not match the pattern {pattern}")
        levels = {field: fit[field] for field in fields if field != FIRST_FIELD}
        rows[name] = (levels, fit[FIRST_FIELD] if FIRST_FIELD in fields else "")
    return _numbered(rows)


def _stem(name: str) -> str:
    return re.sub(r"\.[A-Za-z0-9]{1,4}$", "", name)


def _numbered(rows: dict[str, tuple[dict[str, str], str]]) -> Placed:
    """Number exemplars from 1 within each cell: by their marks, or by file name if there are none."""
    cells: dict[tuple[str, ...], list[tuple[tuple[int, str], str]]] = defaultdict(list)
    for name, (levels, mark) in rows.items():
        order = (int(mark) if mark.isdecimal() else 0, mark or name)
        cells[tuple(levels.values())].append((order, name))
    placed: Placed = {}
    for members in cells.values():
        for number, (_, name) in enumerate(sorted(members), start=1):
            placed[name] = (rows[name][0], number)
    return placed


def check_factorial(placed: Placed) -> None:
    """Raise InputError unless every combination of levels has the same number of clips."""
    if not placed:
        raise InputError("expected at least one clip, got none")
    counts = Counter(tuple(levels.values()) for levels, _ in placed.values())
    known = levels_of(placed)
    cells = prod(map(len, known.values()))
    if len(counts) != cells:
        raise InputError(
            f"expected clips in all {cells} cells of the design, got {len(counts)} of them; "
            f"{_without_clips(known, counts)}"
        )
    largest, smallest = counts.most_common()[0], counts.most_common()[-1]
    if largest[1] != smallest[1]:
        raise InputError(
            f"expected the same number of clips in every cell: {'/'.join(largest[0])} has {largest[1]}, "
            f"{'/'.join(smallest[0])} has {smallest[1]}"
        )
    refuse_reserved_factors(known)


def refuse_reserved_factors(names: Iterable[str]) -> None:
    """Raise InputError if a factor has the name of another column of the answers."""
    if reserved := sorted(set(names) & (reserved_names() - {FIRST_FIELD})):
        raise InputError(
            f"a factor cannot have the name '{reserved[0]}', because a column of the answers has it; use "
            f"another name, such as '{reserved[0]}_shown'"
        )


def _without_clips(known: dict[str, list[str]], present: Collection[tuple[str, ...]]) -> str:
    # One by one: accidental levels, one per file, multiply to more cells than fit in memory.
    missing = (cell for cell in product(*known.values()) if cell not in present)
    named = ["/".join(cell) for cell in islice(missing, MAX_CELLS_NAMED)]
    others = prod(map(len, known.values())) - len(present) - len(named)
    return f"none in {', '.join(named)}" + (f" and {others} more" if others else "")


def levels_of(placed: Placed) -> dict[str, list[str]]:
    """Levels of each factor: numbers and known scales in their order, others in the order of the clips."""
    names = next(iter(placed.values()))[0]
    return {name: in_order([levels[name] for levels, _ in placed.values()]) for name in names}


def check_names(names: Iterable[str]) -> None:
    """Raise InputError if two names are identical on some systems: equal except for case or accent
    encoding."""
    seen: dict[str, str] = {}
    for name in names:
        folded = one_form(name).casefold()
        if folded in seen:
            raise InputError(
                f"'{seen[folded]}' and '{name}' are the same name on some systems; rename one of them"
            )
        seen[folded] = name


def suggest_pattern(names: Iterable[str]) -> str | None:
    """A pattern if every name has the same number of parts, separated by underscores, hyphens or spaces.

    Factors are named after their levels (`factor_names`), or `factor1`, `factor2` and so on. None if the
    names match no pattern, or if they differ only in the number of the clip.
    """
    paths = [PurePosixPath(name) for name in names]
    endings = {path.suffix for path in paths}
    ending = endings.pop() if len(endings) == 1 else ".mp4"
    stems = [path.stem for path in paths]
    for between in ("_", "-", " "):
        if (stem := _suggested(stems, between)) is not None:
            return stem + ending
    whole = "\0"  # in no name: each name is one part
    if any(sign in stem for stem in stems for sign in "_- "):
        return None
    stem = _suggested(stems, whole, least_parts=1)
    return None if stem is None or FIELD.findall(stem)[0] in (FIRST_FIELD, *TAKES) else stem + ending


def _suggested(stems: Sequence[str], between: str, least_parts: int = 2) -> str | None:
    split = [stem.split(between) for stem in stems]
    if not split or len({len(parts) for parts in split}) != 1 or len(split[0]) < least_parts:
        return None
    columns = list(zip(*split, strict=True))
    varying = [position for position, column in enumerate(columns) if len(set(column)) > 1]
    if not varying:
        return None
    words = [column[0] for column in columns]  # a part that all names share is kept
    taken: set[str] = set()
    for number, position in enumerate(varying, start=1):
        guessed, head, tail = name_and_frame(columns[position])
        last = position == len(columns) - 1 and len(varying) > 1
        counts = all(part.removeprefix(head).isdigit() for part in columns[position])
        if last and counts and (head == "" or guessed in TAKES):
            guessed = FIRST_FIELD
        if guessed is None or guessed in taken:
            guessed, head, tail = _free_number(number, taken), "", ""
        taken.add(guessed)
        words[position] = f"{head}{{{guessed}}}{tail}"
    return between.join(words)


def _free_number(number: int, taken: set[str]) -> str:
    """`factor1` and so on, after those used in the names."""
    return next(name for k in count(number) if (name := f"factor{k}") not in taken)
