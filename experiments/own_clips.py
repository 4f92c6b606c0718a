"""Which cell each of somebody's own clips belongs to: by a table of levels, or by a pattern of file names."""

import csv
import io
import re
import unicodedata
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Sequence
from itertools import count, islice, product
from math import prod
from pathlib import PurePosixPath

from experiments.errors import InputError, did_you_mean
from experiments.factor_names import TAKES, name_and_frame
from experiments.level_order import in_order
from experiments.name_patterns import FIELD, NamePattern
from experiments.text_tables import separator_of
from experiments.trials import reserved_names

Placed = dict[str, tuple[dict[str, str], int]]
"""File name -> (levels by factor, exemplar)."""
FIRST_FIELD = "exemplar"
MAX_CELLS_NAMED = 3


def one_form(name: str) -> str:
    """A name in the one form of Unicode that equal-looking names share (NFC)."""
    return unicodedata.normalize("NFC", name)


def levels_from_table(text: str, files: Iterable[str]) -> Placed:
    """Read levels from CSV text; each clip needs one row, each row a clip, every level a value."""
    try:
        return _read_table(text, files)
    except csv.Error as error:
        raise InputError(f"the table is no CSV that can be read ({error}); write it anew") from error


def _read_table(text: str, files: Iterable[str]) -> Placed:
    reader = csv.DictReader(
        io.StringIO(text.lstrip("\ufeff")), delimiter=separator_of(text.partition("\n")[0])
    )
    columns = [name for name in (reader.fieldnames or []) if name]
    if "file" not in columns or len(columns) < 2:
        raise InputError(
            f"expected a CSV with a column 'file' and one a factor, got {', '.join(columns) or 'none'}"
        )
    factors = [name for name in columns if name not in ("file", FIRST_FIELD)]
    refuse_reserved_factors(factors)
    known, rows = set(files), {}
    for number, row in enumerate(reader, start=2):
        name = one_form((row["file"] or "").strip())
        if name not in known:
            raise InputError(
                f"line {number} of the table: no clip is called '{name}'{did_you_mean(name, known)}"
            )
        if name in rows:
            raise InputError(f"line {number} of the table: '{name}' stands there twice")
        levels = {factor: (row[factor] or "").strip() for factor in factors}
        if empty := [factor for factor, level in levels.items() if not level]:
            raise InputError(f"line {number} of the table: '{name}' has no level of '{empty[0]}'")
        rows[name] = (levels, (row.get(FIRST_FIELD) or "").strip())
    if missing := sorted(known - set(rows)):
        raise InputError(f"{len(missing)} clips have no row in the table, the first is '{missing[0]}'")
    return _numbered(rows)


def levels_from_names(pattern: str, files: Iterable[str]) -> Placed:
    """Read levels from file names by a pattern such as `{character}_{speed}_{exemplar}.mp4`."""
    fields = FIELD.findall(pattern)
    refuse_reserved_factors(fields)
    if not [name for name in fields if name != FIRST_FIELD] or len(set(fields)) != len(fields):
        raise InputError(
            "expected a pattern with factors in braces, each once, such as {character}_{exemplar}.mp4"
        )
    whole, by_stem = (NamePattern.read(one_form(text)) for text in (pattern, _stem(pattern)))
    rows = {}
    for name in files:
        fit = by_stem.fit(_stem(name))  # files of several formats follow one pattern
        if fit is None:
            fit = whole.fit(name)
        if fit is None:
            raise InputError(f"the file name '{name}' does not follow the pattern {pattern}")
        levels = {field: fit[field] for field in fields if field != FIRST_FIELD}
        rows[name] = (levels, fit[FIRST_FIELD] if FIRST_FIELD in fields else "")
    return _numbered(rows)


def _stem(name: str) -> str:
    return re.sub(r"\.[A-Za-z0-9]{1,4}$", "", name)


def _numbered(rows: dict[str, tuple[dict[str, str], str]]) -> Placed:
    """Number exemplars from 1 within each cell: in the order of their marks, or of file names without any."""
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
    """InputError unless every combination of levels has the same number of clips."""
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
            f"every cell needs the same number of clips: {'/'.join(largest[0])} has {largest[1]}, "
            f"{'/'.join(smallest[0])} has {smallest[1]}"
        )
    refuse_reserved_factors(known)


def refuse_reserved_factors(names: Iterable[str]) -> None:
    """InputError where a factor has the name of another column of the answers."""
    if reserved := sorted(set(names) & (reserved_names() - {FIRST_FIELD})):
        raise InputError(
            f"a factor cannot be called '{reserved[0]}', the name of a column of the answers; call it, say, "
            f"'{reserved[0]}_shown'"
        )


def _without_clips(known: dict[str, list[str]], present: Collection[tuple[str, ...]]) -> str:
    # Taken one by one: levels by mistake, one a file, multiply to more cells than memory holds.
    missing = (cell for cell in product(*known.values()) if cell not in present)
    named = ["/".join(cell) for cell in islice(missing, MAX_CELLS_NAMED)]
    others = prod(map(len, known.values())) - len(present) - len(named)
    return f"none in {', '.join(named)}" + (f" and {others} more" if others else "")


def levels_of(placed: Placed) -> dict[str, list[str]]:
    """Levels of each factor: those of numbers and known scales in their order, others as clips have them."""
    names = next(iter(placed.values()))[0]
    return {name: in_order([levels[name] for levels, _ in placed.values()]) for name in names}


def check_names(names: Iterable[str]) -> None:
    """InputError where two names are one on some systems: equal but for case or the form of an accent."""
    seen: dict[str, str] = {}
    for name in names:
        folded = one_form(name).casefold()
        if folded in seen:
            raise InputError(
                f"'{seen[folded]}' and '{name}' are one name on some systems; rename one of them"
            )
        seen[folded] = name


def suggest_pattern(names: Iterable[str]) -> str | None:
    """A pattern where every name has as many parts between underscores, hyphens or blanks, or is one part.

    Factors are called by what their levels give away (`factor_names`), else `factor1`, `factor2` and so on.
    None where the names follow no pattern, and where all that varies is a number of the clip.
    """
    paths = [PurePosixPath(name) for name in names]
    endings = {path.suffix for path in paths}
    ending = endings.pop() if len(endings) == 1 else ".mp4"
    stems = [path.stem for path in paths]
    for between in ("_", "-", " "):
        if (stem := _suggested(stems, between)) is not None:
            return stem + ending
    whole = "\0"  # in no name: the names are one part each
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
    words = [column[0] for column in columns]  # a part that every name has stands as it is
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
    """`factor1` and so on, after those that the names themselves have taken."""
    return next(name for k in count(number) if (name := f"factor{k}") not in taken)
