"""The counts of one run, as each play changes them, and the two texts they are stored as.

An answer is packed into eight bytes: 18 bits for the clip, 18 for a second clip (from 1; 0 for none)
and 28 for the value in thousandths. So a million of them are read and counted in a fraction of a second,
without a package for numbers.
"""

import json
import math
import sys
from array import array
from base64 import b64encode
from binascii import a2b_base64
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, NamedTuple

LETTERS = {"good": "g", "uncertain": "u", "flagged": "f", "failed": "x"}
"""A trial's letter in the heat map, by its best verdict; `.` if it was not shown yet."""
_BETTER = {".": 0, "x": 1, "f": 2, "u": 3, "g": 4}
RT_MS, ONSET_MS, ONSET_BINS = 250, 10, 11
"""Widths of the bins of response times and of times from key to first frame; the last of these is open."""
UNIT = 1000
"""Values are counted in whole thousandths, so that sums are the same in whatever order answers come."""
_CLIP_BITS, _VALUE_BITS = 18, 28
# Half of the range, so that negative values are stored as positive numbers.
_ZERO = 1 << _VALUE_BITS - 1


class ClipTime(NamedTuple):
    """Total clip time of a run's answers, and the times of its first ticket, newest ticket and last answer.

    Attributes
    ----------
    clip_ms : float
        Of all answers.
    newest_clip_ms : float
        Of those by tickets issued at `newest_issued_at`.
    first_issued_at, newest_issued_at : datetime or None
        When tickets of answers were issued; None where no answer brought one.
    last_received_at : datetime or None
        When the last answer came, by the server's clock.
    """

    clip_ms: float = 0.0
    newest_clip_ms: float = 0.0
    first_issued_at: datetime | None = None
    newest_issued_at: datetime | None = None
    last_received_at: datetime | None = None

    def plus(self, clip_ms: float, issued_at: datetime, received_at: datetime) -> "ClipTime":
        """With one more answer: the same in whatever order they come."""
        first, newest, last = self[2:]
        # Two sums are enough: tickets come from the page that was loaded last, but for those it replaced.
        is_newer = newest is None or issued_at > newest
        before_ms = 0.0 if is_newer else self.newest_clip_ms
        return ClipTime(
            self.clip_ms + clip_ms,
            before_ms + clip_ms * (is_newer or issued_at == newest),
            issued_at if first is None else min(first, issued_at),
            issued_at if newest is None else max(newest, issued_at),
            received_at if last is None else max(last, received_at),
        )

    def same(self, other: "ClipTime") -> bool:
        """Equal up to rounding from the order of addition."""
        sums = zip(self[:2], other[:2], strict=True)
        # Moments are exact; sums of floats depend on the order of their terms.
        return self[2:] == other[2:] and all(math.isclose(one, two, abs_tol=1e-6) for one, two in sums)

    def since(self, issued_at: datetime) -> float | None:
        """Clip time in ms of answers by tickets issued from then on; None where these sums do not say."""
        if self.newest_issued_at is None or issued_at > self.newest_issued_at:
            return 0.0
        if issued_at == self.newest_issued_at:
            return self.newest_clip_ms
        # From the first ticket on: that is all of the time.
        is_first = self.first_issued_at is not None and issued_at <= self.first_issued_at
        return self.clip_ms if is_first else None


class NumberedClip(NamedTuple):
    """A clip in its study version: its number among the clips, from 0, and that of its cell."""

    clip: int
    cell: int


def numbers(clips: Iterable[tuple[int, str]]) -> dict[int, NumberedClip]:
    """The place of each clip (its id, its cell) of a version, given in the order of their ids.

    Cells are numbered as they come. A version that was used keeps its clips, so the numbers stay.
    """
    cells: dict[str, int] = {}
    return {
        # A dict keeps the order of insertion, so its length is the next number.
        clip: NumberedClip(number, cells.setdefault(cell, len(cells)))
        for number, (clip, cell) in enumerate(clips)
    }


class TallyEntry(NamedTuple):
    """One answer to one trial on one scale.

    Attributes
    ----------
    scale : str
        Its name; empty where trials are not rated on scales.
    clip, second : int, int or None
        Numbers of the clips in the version (`NumberedClip`); second is None where a trial shows one.
    value : float
        The answer as a number.
    cell : int or None
        Of the clip, where the mean of values by cell means something.
    """

    scale: str
    clip: int
    second: int | None
    value: float
    cell: int | None = None

    def packed(self) -> int:
        """As one number of 64 bits."""
        second = 0 if self.second is None else self.second + 1
        # One number per answer: a million ratings are then 8 MB, which results read in one piece.
        return (self.clip << _CLIP_BITS | second) << _VALUE_BITS | (self.units + _ZERO)

    @property
    def units(self) -> int:
        """The value in whole thousandths, within what 28 bits hold."""
        # Held at the ends: a value that does not fit must not spill into the clip's bits.
        return min(_ZERO - 1, max(-_ZERO, round(UNIT * self.value)))


def unpack_answer(code: int) -> tuple[int, int | None, float]:
    """Clip, second clip and value of a packed answer."""
    # Undoes `packed`: the second clip counts from 1, and 0 says that there is none.
    clip, second = divmod(code >> _VALUE_BITS, 1 << _CLIP_BITS)
    return clip, second - 1 if second else None, (code % (1 << _VALUE_BITS) - _ZERO) / UNIT


class Play(NamedTuple):
    """What is counted of one stored play.

    Attributes
    ----------
    is_main : bool
        Of a main trial; of others the heat map alone is kept.
    rt, onset : float or None
        In ms; None where not measured.
    answers : tuple of TallyEntry
        Empty where none was given.
    """

    trial_index: int
    is_main: bool
    verdict: str
    rule: str
    method: str
    rt: float | None
    onset: float | None
    answers: tuple[TallyEntry, ...]


COLUMNS = ("heat", "not_good", "counts", "answers", *ClipTime._fields)
"""The columns of `RunTally`, without its run."""

PlayKey = str
"""Verdict, method and rule of plays, with a blank between them."""


@dataclass
class Tally:
    """The counts of one run.

    Attributes
    ----------
    heat : str
        One letter per trial, as far as trials were shown.
    not_good : int
        Plays flagged or failed, of any trial.
    plays : dict of PlayKey to int
        Of main trials.
    times : dict of str to int
        Bin of 250 ms -> answers.
    onsets : list of int
        Answers by bins of 10 ms.
    cells : dict of str to list of int
        Scale -> answers of cell 0 and their sum in thousandths, then of cell 1, and so on.
    answers : dict of str to array
        Scale -> packed answers.
    clip_time : ClipTime
        What the answers that brought tickets took of the run's time.
    """

    heat: str = ""
    not_good: int = 0
    plays: dict[PlayKey, int] = field(default_factory=dict)
    times: dict[str, int] = field(default_factory=dict)
    onsets: list[int] = field(default_factory=list)
    cells: dict[str, list[int]] = field(default_factory=dict)
    answers: "dict[str, array[int]]" = field(default_factory=dict)
    clip_time: ClipTime = field(default_factory=ClipTime)

    def add(self, play: Play) -> None:
        """Count one more play."""
        # Practice and attention checks are in the heat map, too.
        self._mark(play.trial_index, LETTERS[play.verdict])
        self.not_good += play.verdict in ("flagged", "failed")
        if not play.is_main:
            return
        # The rule comes last and may be empty.
        key = f"{play.verdict} {play.method} {play.rule}"
        self.plays[key] = self.plays.get(key, 0) + 1
        # What is counted for results is what the analysis keeps; a failed play counts in `plays` alone.
        if play.verdict == "failed" or not play.answers:
            return
        if play.rt is not None:
            # A text, as keys of JSON are.
            time = str(int(play.rt // RT_MS))
            self.times[time] = self.times.get(time, 0) + 1
        if play.onset is not None:
            # Made when needed: studies without measured onsets store an empty list.
            self.onsets = self.onsets or [0] * ONSET_BINS
            self.onsets[min(int(play.onset // ONSET_MS), ONSET_BINS - 1)] += 1
        for answer in play.answers:
            self._take(answer)

    def _mark(self, trial: int, letter: str) -> None:
        heat = self.heat.ljust(trial + 1, ".")
        # The best play counts: a repeat after a failed one settles the trial.
        if _BETTER[letter] > _BETTER[heat[trial]]:
            heat = heat[:trial] + letter + heat[trial + 1 :]
        self.heat = heat

    def _take(self, answer: TallyEntry) -> None:
        # Q: unsigned numbers of 8 bytes.
        self.answers.setdefault(answer.scale, array("Q")).append(answer.packed())
        if answer.cell is None:
            return
        sums = self.cells.setdefault(answer.scale, [])
        # Grown to the cell's place: cells before it without an answer hold zeros.
        sums.extend([0] * (2 * answer.cell + 2 - len(sums)))
        sums[2 * answer.cell] += 1
        sums[2 * answer.cell + 1] += answer.units

    def values(self) -> dict[str, Any]:
        """The columns of `RunTally`."""
        counts = {name: getattr(self, name) for name in ("plays", "times", "onsets", "cells")}
        packed = {scale: packed_text(codes) for scale, codes in self.answers.items()}
        return {
            "heat": self.heat,
            "not_good": self.not_good,
            # Without blanks: one text for each run is read for every result.
            "counts": json.dumps(counts, separators=(",", ":")),
            "answers": json.dumps(packed, separators=(",", ":")),
            **self.clip_time._asdict(),
        }

    def same(self, other: "Tally") -> bool:
        """True where the same was counted, in whatever order."""
        return self._sorted() == other._sorted() and self.clip_time.same(other.clip_time)

    def _sorted(self) -> tuple[Any, ...]:
        # Sorted, as answers may have been stored in another order than counted.
        answers = {scale: sorted(codes) for scale, codes in self.answers.items()}
        return self.heat, self.not_good, self.plays, self.times, self.onsets, self.cells, answers


def packed_text(codes: "array[int]") -> str:
    """Packed answers as text (base64), the lowest byte first on every machine."""
    return b64encode(_little(codes).tobytes()).decode()


def packed_bytes(text: str) -> bytes:
    """The packed answers of a text, as bytes that may be put behind others."""
    return a2b_base64(text)


def packed_codes(packed: bytes | bytearray) -> "array[int]":
    """The packed answers of `packed_bytes`."""
    codes = array("Q")
    codes.frombytes(packed)
    return _little(codes)


def _little(codes: "array[int]") -> "array[int]":
    # A database may move between machines: what is stored has one order of bytes.
    if sys.byteorder == "little":
        return codes
    turned = array("Q", codes)
    turned.byteswap()
    return turned


def tally_of(heat: str, not_good: int, counts: str, answers: str, *clip_time: Any) -> Tally:
    """The tally that was stored as these columns, in the order of `COLUMNS`."""
    packed: Mapping[str, str] = json.loads(answers)
    return Tally(
        heat=heat,
        not_good=not_good,
        **json.loads(counts),
        answers={scale: packed_codes(packed_bytes(text)) for scale, text in packed.items()},
        clip_time=ClipTime(*clip_time),
    )
