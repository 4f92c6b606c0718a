"""Which columns of a table are the series to label: their names, validity, direction and gaps."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise, zip_longest
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.errors import InputError, nearest
from stimuli_builder.blinks.csv_table import few
from stimuli_builder.blinks.profile import OPEN_PERCENTILE, Array, Eye
from stimuli_builder.blinks.times import is_time, runs

# What the name of a column says: which eye it is of, and whether high is shut.

_WORD = re.compile(r"[A-Z]{2,}(?=left|right|$|[^A-Za-z])|[A-Z]?[a-z]+|[A-Z]+(?![a-z])|[0-9]+")
"""A word of a column's name: EAR_l, leftEAR, EARleft, l_ear, EyeBlinkLeft."""
_ACTION_UNIT = re.compile(r"AU[0-9]+_[rc](?![a-z])", re.IGNORECASE)
"""OpenFace's: r is a regression's intensity, not the right eye."""
_SIDES: dict[str, Eye] = {
    "l": "left", "left": "left", "lefteye": "left", "leye": "left",
    "r": "right", "right": "right", "righteye": "right", "reye": "right",
}  # fmt: skip
_SIDED = re.compile(
    r"(?P<first>left|right)(eye|ear|gap|blink|lid|distance)|(eye|ear|gap|blink|lid|eyeblink)(?P<last>left|right)"
)
"""Words written together: lefteye, eyeblinkleft; not leftover, rightmost."""
_NO_SIDE_BEFORE = re.compile(r"[0-9]+|squared")
"""What makes a single letter before it not a side: L2, r_squared."""
_CLOSURES = frozenset({"closure", "closedness", "au45"})
_SHUT = frozenset({"blink", "closed"})
"""Words of columns that are high where the lids are shut: ARKit's eyeBlinkLeft, OpenFace's AU45_r."""
_OPENINGS = frozenset(
    {"distance", "ear", "gap", "opening", "aperture", "openness", "fissure", "height", "px", "mm"}
)
"""Words of a distance, by which blink and closed say only what it was measured for: blink_ear, closed_px."""


_LIDS = frozenset({"ear", "aperture", "openness", "fissure", "closure", "closedness", "au45", "eyeblink"})
"""Words of lids alone, by which a tracker's two columns are known among those of pupils and gaze."""


def words_of(column: str) -> list[str]:
    """The words of a column's name in small letters: left and ear for leftEAR."""
    return [word.lower() for word in _WORD.findall(column)]


def eye_of(column: str) -> Eye | None:
    """The eye named by the words of a column's name: l, left, r, right; else None."""
    # The r of AU45_r would be read as the right eye.
    if _ACTION_UNIT.match(column):
        return None
    words = words_of(column)
    sides = {
        side
        for word, following in zip_longest(words, words[1:], fillvalue="")
        if (side := _side(word)) and not (len(word) == 1 and _NO_SIDE_BEFORE.fullmatch(following))
    }
    # A name with both sides (left_minus_right) is of neither eye.
    return sides.pop() if len(sides) == 1 else None


def eye_pair(columns: Sequence[str]) -> tuple[int, int] | None:
    """Numbers of the left and the right eye's columns; None where not one is of each."""
    return left_and_right([eye_of(column) for column in columns])


def left_and_right(eyes: Sequence[Eye | None]) -> tuple[int, int] | None:
    """Numbers of the one left and the one right eye; None where there are none, or more."""
    if eyes.count("left") != 1 or eyes.count("right") != 1:
        return None
    return eyes.index("left"), eyes.index("right")


def _side(word: str) -> Eye | None:
    """The eye of one word in small letters."""
    sided = _SIDED.fullmatch(word)
    # The group that did not match is None.
    return _SIDES.get(word if sided is None else sided["first"] or sided["last"])


def is_of_lids(column: str) -> bool:
    """Whether a column's name says that it is the opening or closure of an eye, not a pupil or a gaze."""
    words = words_of(column)
    # Words in pairs, too: eyeBlinkLeft has eye and blink as separate words.
    return not _LIDS.isdisjoint({*words, *("".join(pair) for pair in pairwise(words))})


def is_high_when_shut(column: str) -> bool:
    """Whether a column's name is one of a closure, not of an opening."""
    words = words_of(column)
    pairs = {"".join(pair) for pair in pairwise(words)}
    known = pairs.union(words)
    # Blink and closed mean a closure only without a word of distance: blink_ear is an opening.
    return not _CLOSURES.isdisjoint(known) or (not _SHUT.isdisjoint(known) and _OPENINGS.isdisjoint(known))


# Frames of which their table itself says that they are not to be believed.

VALID_COLUMNS = ("valid", "success")
"""1 where a frame was measured, 0 where not; 'success' is OpenFace's."""
_VALID = frozenset(VALID_COLUMNS)
_OF_ALL = _VALID | {"confidence", "is", "face", "eye", "eyes", "frame", "tracking", "detection", "landmarks"}
"""Words of a validity's name that are of no columns in particular."""
_OF_OTHERS = frozenset({"not", "invalid", "blink", "trial", "task", "response"})
"""With these it says something else than which frames were measured: valid_blink, trial_success."""
CONFIDENCE_COLUMN = "confidence"
LEAST_CONFIDENCE = 0.5
"""From 0 to 1, as OpenFace writes it next to 'success'; below it a frame is more likely wrong than right."""
_WORDS = {"true": True, "1": True, "1.0": True, "false": False, "0": False, "0.0": False}


def is_validity(name: str) -> bool:
    """Whether a column's name is one of validity: valid, success, EAR2D6_valid, BS_Valid, valid_left."""
    # Without the side: left_valid and valid_left are the same.
    words = [word for word in words_of(name) if eye_of(word) is None]
    # First or last word only: in the middle of a name the word says something else.
    return bool(words) and not _VALID.isdisjoint({words[0], words[-1]})


def unseen_rows(
    table: pd.DataFrame, columns: Sequence[str], path: Path
) -> tuple[dict[str, NDArray[np.bool_]], list[str]]:
    """Rows whose values are not to be believed by the table's own columns, and a line about each reason.

    A validity with a side in its name (left_valid) is of that eye's columns alone, one with further words
    (BS_Valid) of the columns whose names begin with them (BS_gap). With more than `VALID_COLUMNS` in its
    name it is heeded where it holds 0 and 1 only, and a blank says nothing there.

    Parameters
    ----------
    columns : sequence of str
        The series that are labeled.

    Returns
    -------
    unseen : dict of str to (rows,) bool array
        By column of `columns`.
    notes : list of str

    Raises
    ------
    InputError
        A column of `VALID_COLUMNS` holds something else than 0 and 1, one of confidence is not from 0 to 1,
        or no row of a series is left.
    """
    unseen = {column: np.zeros(len(table), np.bool_) for column in columns}
    notes = []
    for name in map(str, table.columns):
        rows, why = _doubted(table[name], path)
        heeding = [column for column in columns if _is_about(name, column)]
        # No line about a validity that doubts nothing.
        if not rows.any() or not heeding:
            continue
        eye = "" if len(heeding) == len(columns) else f" of {', '.join(heeding)}"
        notes.append(f"{path.name}: {rows.sum():,} of {rows.size:,} frames{eye} {why}: treated as missing")
        for column in heeding:
            unseen[column] |= rows
    # A column of zeros is more likely misnamed than a recording without one valid frame.
    if any(rows.all() for rows in unseen.values()):
        raise InputError(f"{'; '.join(notes)}; no frames are left: remove the column if it is wrong")
    return unseen, notes + _doubtful(table, path)


def _doubted(column: pd.Series, path: Path) -> tuple[NDArray[np.bool_], str]:
    """(rows,) of a validity or confidence that are not to be believed, and why; none of another column."""
    name = str(column.name)
    if name.lower() == CONFIDENCE_COLUMN:
        return _not_sure(column, path), f"have a '{name}' below {LEAST_CONFIDENCE:g}"
    if name.lower() in VALID_COLUMNS:
        # By its exact name a blank is not valid; under any other name a blank says nothing.
        return _not_valid(_cells(column, blank="0"), path), f"are not valid by '{name}'"
    if is_validity(name) and not _other_words(cells := _cells(column, blank="1")):
        return _not_valid(cells, path), f"are not valid by '{name}'"
    return np.zeros(column.size, np.bool_), ""


def _is_about(name: str, column: str) -> bool:
    """Whether a validity is one of a series: of its eye, and by no words but such as its name begins with."""
    side, eye = eye_of(name), eye_of(column)
    if not _OF_OTHERS.isdisjoint(words_of(name)) or (side and eye and side != eye):
        return False
    words = _own_words(name)
    # With and without general words: BS_Valid is about BS_gap and about eye_BS_gap.
    beginnings = {*accumulate(words_of(column)), *accumulate(_own_words(column))}
    return not words or "".join(words) in beginnings


def _own_words(name: str) -> list[str]:
    return [word for word in words_of(name) if word not in _OF_ALL and eye_of(word) is None]


def _cells(column: pd.Series, blank: str) -> "pd.Series[str]":
    # Text, numbers and booleans alike: trackers write 1, 1.0 and True.
    return column.map(lambda cell: blank if pd.isna(cell) else str(cell).strip().lower())


def _other_words(cells: "pd.Series[str]") -> list[str]:
    """Values other than 0 and 1, true and false, that a column has."""
    return [word for word in cells.unique() if word not in _WORDS]


def _not_valid(words: "pd.Series[str]", path: Path) -> NDArray[np.bool_]:
    if other := _other_words(words):
        raise InputError(
            f"{path.name}: column '{words.name}' marks valid frames with 1 or 0 (true or false), got "
            f"'{other[0]}'; rename the column if it means something else"
        )
    return ~words.map(_WORDS).to_numpy(dtype=np.bool_)


def _not_sure(column: pd.Series, path: Path) -> NDArray[np.bool_]:
    values = pd.to_numeric(column, errors="coerce").to_numpy(dtype=np.float64)
    words = column[np.isnan(values) & column.notna().to_numpy()]
    if words.size:
        raise InputError(
            f"{path.name}: column '{column.name}' must have numbers between 0 and 1, got {words.iloc[0]!r}; "
            "correct it, or rename the column"
        )
    if (values < 0).any() or (values > 1).any():
        raise InputError(
            f"{path.name}: column '{column.name}' must be between 0 and 1, got {np.nanmin(values):g} to "
            f"{np.nanmax(values):g}; rescale it, or rename the column"
        )
    # Written so that a blank cell (NaN) counts as not sure.
    return np.asarray(~(values >= LEAST_CONFIDENCE))


def _doubtful(table: pd.DataFrame, path: Path) -> list[str]:
    """A line about the frames whose points a track doubts: they are given, and may be wrong."""
    count = int((table["status"] == "doubtful").sum()) if "status" in table.columns else 0
    if not count:
        return []
    return [
        f"{path.name}: {count:,} of {len(table):,} frames are doubtful: they were used, but their points may "
        "be wrong"
    ]


# Which columns of a table are the series to label.

DISTANCE_COLUMNS = ("left_distance_px", "right_distance_px", "distance_px")
INDEX_COLUMNS = ("frame", CONFIDENCE_COLUMN)


def choose_columns(table: pd.DataFrame, named: Sequence[str], path: Path) -> tuple[list[str], list[str]]:
    """The distance columns to label: those named, else a track's, else the only candidate or pair of eyes.

    Of several, a column with only 0 and 1, or equal to an earlier one, is not a second eye and is ignored.

    Returns
    -------
    columns, notes : list of str
        And a line about each that is left out, and about eyes that were taken without being named.
    """
    candidates = [
        str(name)
        for name in table.columns
        if table[name].dtype.kind == "f" and not _is_of_another_kind(str(name))
    ]
    for name in named:
        if name not in table.columns:
            raise InputError(f"{path.name} has no column '{name}'{_near_or_plausible(name, candidates)}")
    if named:
        return _distinct(table, list(dict.fromkeys(named)), path)
    # Columns of a track, known by their exact names, win over any guess.
    tracked = [name for name in DISTANCE_COLUMNS if name in table.columns]
    if tracked:
        return tracked, []
    # Columns of 0 and 1 mark blinks, they do not measure an opening.
    measures = [name for name in candidates if not _is_presence(table[name])]
    if len(measures) == 1 or len(candidates) == 1:
        return measures or candidates, []
    lids = [name for name in measures if is_of_lids(name)]
    # Other columns of numbers (gaze, pupil) come with most trackers.
    if len(lids) == 2 and eye_pair(lids) is not None:
        measures = lids
    if len(measures) == 2 and eye_pair(measures) is not None:
        eyes = " and ".join(f"'{name}'" for name in measures)
        return measures, [f"{path.name}: {eyes} are used as the two eyes; select others with --column NAME"]
    raise InputError(f"{path.name}: {_not_chosen(table, candidates)}")


def _distinct(table: pd.DataFrame, named: list[str], path: Path) -> tuple[list[str], list[str]]:
    """The columns that may be different eyes, and a line about each of the others."""
    kept: list[str] = []
    notes = []
    measures = [name for name in named if not _is_presence(table[name])]
    for name in named:
        # Two eyes never have the same values in every frame.
        twin = next((one for one in kept if table[one].equals(table[name])), None)
        if measures and name not in measures:
            notes.append(f"{path.name}: '{name}' has only 0 and 1, so it is not an eye opening: ignored")
        elif twin is not None:
            notes.append(
                f"{path.name}: '{name}' has the same values as '{twin}', so it is not a second eye: ignored"
            )
        else:
            kept.append(name)
    return kept, notes


def _is_presence(column: pd.Series) -> bool:
    """Whether a column says by 0 and 1 alone that something is there, as OpenFace's AU45_c."""
    # Both values must occur: of a column of zeros nobody knows what it is.
    return column.dtype.kind in "fiub" and set(column.dropna().unique().tolist()) == {0, 1}


def _not_chosen(table: pd.DataFrame, candidates: Sequence[str]) -> str:
    """Why no column is chosen, and what to do."""
    if candidates:
        return f"select the series with --column; the table has {few(candidates)}"
    whole = [
        f"'{name}' (whole numbers)"
        for name in table.columns
        if table[name].dtype.kind in "iu" and not _is_of_another_kind(str(name))
    ]
    if not whole:
        return "select the series with --column; the table has no column of numbers except the times"
    return (
        f"expected a column of decimal numbers, got {few(whole)}; if one of them is the distance, select it "
        "with --column"
    )


def _is_of_another_kind(name: str) -> bool:
    """Whether a column's name is one of frame numbers, times or validity."""
    # Such columns are decimals as well and would be taken for distances.
    return name.lower() in INDEX_COLUMNS or is_validity(name) or is_time(name)


def _near_or_plausible(name: str, candidates: Sequence[str]) -> str:
    near = nearest(name, candidates)
    if near is not None:
        return f"; did you mean '{near}'?"
    plausible = few([one for one in candidates if one in DISTANCE_COLUMNS] or candidates)
    return f"; expected one of: {plausible}" if plausible else ""


# Values that are not lids: one that a tracker repeats for seconds, and zeros where it found no face.

FROZEN_S = 1.0
MAX_REPEATS = 0.1
"""Where more samples than this part repeat the one before, values are coarse, and repeat by themselves."""
REVERSALS_A_S = 6.0
"""Noise goes up and down at least so often in a second; a curve without noise does by its blinks alone."""
SHUT_SHARE = 0.2
"""Part of the way from the least value to the opening below which a value that stays is of shut lids."""
JUMP_SHARE = 0.6
"""Part of the opening that no lid leaves, nor comes back to, from one frame to the next."""
LEAST_JUMP_FPS = 24.5
"""Of 25 frames a second, whose times may be a little less. In a longer frame a lid goes so far."""
NOT_SEEN = "treated as missing"
LEFT = "kept: nothing else closes in this column, so these may be its blinks"
NEAR_ZERO = 0.1
"""Part of the opening; a series that comes below it without being 0 has lids that meet at 0."""


@dataclass(frozen=True)
class _Kind:
    """Rows that hold no measurement, or may not: (start, stop) of each run, and what they do in words.

    Of a run the first `measured` rows were measured.
    """

    what: str
    spans: Sequence[tuple[int, int]]
    measured: int = 0
    becomes: str = NOT_SEEN

    def when(self, fps: float, times_s: Array) -> str:
        """How often, how long, and from when on."""
        times = "once" if len(self.spans) == 1 else f"{len(self.spans)} times"
        seconds = sum(stop - start for start, stop in self.spans) / fps
        return f"{times}, {seconds:.3g} s, first at {times_s[self.spans[0][0]]:.4g} s"


def without_what_is_not_measured(
    opening: Array, fps: float, times_s: Array, column: str, path: Path, *, turned: bool
) -> tuple[Array, list[str]]:
    """A column, NaN where it holds no measurement, and a line about each reason.

    Parameters
    ----------
    opening : (n,) float64 array
        The column as an opening; NaN where it is known not to be seen.
    fps : float
    times_s : (n,) float64 array
        From the first row.
    turned : bool
        Whether the column was turned round: its zeros are of lids that are shut.
    """
    eye = eye_of(column)
    label = f"{path.name}: '{column}'" + (f" ({eye} eye)" if eye else "")
    kinds = [_Kind("repeats one value for at least one second", _frozen_runs(opening, fps), measured=1)]
    # In a long frame lids may close and open; in a turned column 0 is a shut eye.
    if not turned and fps >= LEAST_JUMP_FPS:
        kinds.append(_zeros(opening))
    notes, kept = [], opening.copy()
    for kind in kinds:
        if not kind.spans:
            continue
        for start, stop in kind.spans if kind.becomes == NOT_SEEN else ():
            kept[start + kind.measured : stop] = np.nan
        notes.append(f"{label} {kind.what}: {kind.when(fps, times_s)}: {kind.becomes}")
    return kept, notes


def _frozen_runs(values: Array, fps: float) -> list[tuple[int, int]]:
    """(start, stop) of equal values for `FROZEN_S` or longer, between shut lids and the greatest value.

    Only where the series has noise elsewhere; in a curve without noise a lid at rest repeats its value.
    """
    # NaN differs from itself, so gaps never count as repeats.
    repeats = np.concatenate([[False], values[1:] == values[:-1]])
    # Repeats begin one row after the value that they repeat.
    spans = [(a - 1, b) for a, b in runs(repeats) if b - a + 1 >= FROZEN_S * fps]
    elsewhere = np.isfinite(values)
    for start, stop in spans:
        elsewhere[start:stop] = False
    if not spans or not _has_noise(values, elsewhere, fps):
        return []
    low, middle, high = np.percentile(values[elsewhere], [0, OPEN_PERCENTILE, 100])
    # Shut lids and a clipped maximum repeat values for good reasons.
    shut = low + SHUT_SHARE * (middle - low)
    return [(start, stop) for start, stop in spans if shut < values[start] < high]


def _has_noise(values: Array, elsewhere: NDArray[np.bool_], fps: float) -> bool:
    """Whether a second or more elsewhere goes up and down as noise does, and seldom repeats a value."""
    steps = np.diff(values)[elsewhere[1:] & elsewhere[:-1]]
    # Less than a second does not show whether there is noise.
    if steps.size < fps:
        return False
    signs = np.sign(steps[steps != 0])
    reversals = float((signs[1:] != signs[:-1]).sum())
    return bool((steps == 0).mean() <= MAX_REPEATS and reversals >= REVERSALS_A_S * steps.size / fps)


def _zeros(values: Array) -> _Kind:
    """Zeros between open lids, in a series that else stays far from 0; not seen where it has other dips."""
    what = "jumps to 0 and back from one frame to the next"
    zero = values == 0
    others = values[np.isfinite(values) & ~zero]
    if not zero.any() or not others.size:
        return _Kind(what, [])
    opening = float(np.percentile(others, OPEN_PERCENTILE))
    # A blink reaches values near 0 by itself, so zeros next to them are plausible.
    if others.min() < NEAR_ZERO * opening:
        return _Kind(what, [])
    low = values < JUMP_SHARE * opening
    # A frame without a value (NaN) next to a zero is not evidence of a moving lid either: it is not low.
    jumps = [(a, b) for a, b in runs(zero) if not low[max(0, a - 1) : a].any() and not low[b : b + 1].any()]
    has_other_dips = any(not zero[a:b].any() for a, b in runs(low))
    return _Kind(what, jumps, becomes=NOT_SEEN if has_other_dips else LEFT)


# Series that are high where the lids are shut, turned round: closures, blendshapes, action units.

REST = 0.25
"""A series that rests below this part of its top, and is above half of it for no longer than this part of the
time, is one of a closure, or of eyes that are shut nearly always: a person says which."""
TOP_PERCENTILE = 99.5
RESTS_HIGH = 0.6
"""A series that is named as a closure and rests above this part of its top is none, or of shut eyes."""
GLITCH, GLITCHES = 2.0, 3
"""A greatest value that is this many times the third greatest is a glitch, and no level of a shut lid."""
_WAYS = "add --inverted if high means closed, --not-inverted if high means open"


def opening_of(
    values: Array, column: str, path: Path, inverted: bool | None, same_kind: Sequence[Array]
) -> tuple[Array, str]:
    """Return a column as an opening, 0 where the lids meet, and a line if it was turned round for that.

    Closures up to 1 become 1 - closure; others are taken from their greatest value that is not a glitch.

    Parameters
    ----------
    inverted : bool or None
        Whether high means closed; None decides by the column's name.
    same_kind : sequence of float64 array
        The column and those of its kind, as the other eye's: one greatest value holds for all, so that an eye
        that closes less keeps to be seen as such.

    Raises
    ------
    InputError
        Nobody says, and the series looks otherwise than its name.
    """
    by_name, known = is_high_when_shut(column), values[np.isfinite(values)]
    if inverted is None and not by_name and _rests_at_the_bottom(known):
        raise InputError(
            f"{path.name}: column '{column}' rests at {np.median(known):.3g} and rises to {known.max():.3g} "
            f"for short times, like a closure (1 = closed): {_WAYS}"
        )
    if inverted is None and by_name and _rests_high(known):
        raise InputError(
            f"{path.name}: column '{column}' is named as a closure (1 = closed) but rests at "
            f"{np.median(known):.3g}, near its maximum, like an opening: {_WAYS}"
        )
    if not (by_name if inverted is None else inverted) or not known.size:
        return values, ""
    # At least 1, the greatest value of most closures, also where no blink was complete.
    top = max(1.0, *(_top(one[np.isfinite(one)]) for one in same_kind))
    why = "as its name says" if inverted is None else "as set by --inverted"
    return (
        np.maximum(top - values, 0.0),
        f"{path.name}: '{column}' is high when lids are closed, {why}: {top:g} minus the value was used",
    )


def _top(known: Array) -> float:
    """The greatest value; the third greatest where that is a glitch; 0 of none."""
    if not known.size:
        return 0.0
    count = min(GLITCHES, known.size)
    highest = np.sort(np.partition(known, -count)[-count:])
    # By the 0.5 a greatest value up to 1, as closures have, is never a glitch.
    return float(highest[0] if highest[-1] > GLITCH * max(highest[0], 0.5) else highest[-1])


def _rests_high(known: Array) -> bool:
    return bool(known.size and np.median(known) > RESTS_HIGH * np.percentile(known, TOP_PERCENTILE) > 0)


def _rests_at_the_bottom(known: Array) -> bool:
    if not known.size:
        return False
    middle, top = np.percentile(known, [50, TOP_PERCENTILE])
    return bool(0 <= middle < REST * top and (known > top / 2).mean() <= REST)
