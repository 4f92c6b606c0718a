"""One reader of tables for every program: CSV in every encoding and dialect, Excel, SPSS and JSON."""

from collections.abc import Iterable
from difflib import get_close_matches


# Decision 0001: One contract package.
class InputError(ValueError):
    """Input a person gave cannot be used. The message is one line, meant for that person.

    Command lines print it without a traceback and exit with code 2; the server answers with a 4xx.
    """


def nearest(word: str, candidates: Iterable[str], cutoff: float = 0.5) -> str | None:
    """Return the candidate most like `word`, or None where none is as like as `cutoff` (1: the same)."""
    choices = {candidate.casefold(): candidate for candidate in candidates}
    nearest = get_close_matches(word.casefold(), list(choices), n=1, cutoff=cutoff)
    return choices[nearest[0]] if nearest else None


def did_you_mean(word: str, candidates: Iterable[str]) -> str:
    """Return `; did you mean 'x'?` or the list of what is allowed, ready to end an error line."""
    allowed = list(candidates)
    near = nearest(word, allowed)
    if near is not None:
        return f"; did you mean '{near}'?"
    return f"; expected one of: {', '.join(allowed)}" if allowed else ""


# Numbers with the noun that they count.


def counted(number: int, noun: str) -> str:
    """How many of what.

    Examples
    --------
    >>> counted(1, "blink")
    '1 blink'
    >>> counted(2000, "frame")
    '2,000 frames'
    """
    return f"{number:,} {noun}{'' if number == 1 else 's'}"
