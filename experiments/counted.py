"""Numbers with the noun that they count."""


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
