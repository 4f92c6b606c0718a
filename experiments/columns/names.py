"""Names of columns made from names of levels, options and questions, which may be written in any script."""

import re
import unicodedata


def plain_name(text: str) -> str:
    """Letters, digits and underscores of `text`, accents off; `x` and the letters' code points where none.

    >>> plain_name("fast & near"), plain_name("Größe"), plain_name("-1.5"), plain_name("速")
    ('fast_near', 'Grosse', 'minus1_5', 'x901f')
    """
    signed = re.sub(r"^[-−](?=[\d.])", "minus", text.strip()).replace("ß", "ss")
    folded = unicodedata.normalize("NFKD", signed).encode("ascii", "ignore").decode()
    plain = re.sub(r"[^A-Za-z0-9]+", "_", folded).strip("_")
    return plain or "x" + "_".join(f"{ord(letter):x}" for letter in text[:8])


def unlike(name: str, taken: set[str]) -> str:
    """`name`, with a number after it where it is taken already (whatever the case); it is taken then."""
    free, number = name, 2
    while free.casefold() in taken:
        free, number = f"{name}_{number}", number + 1
    taken.add(free.casefold())
    return free
