"""Words of motion checks in Dutch.

Unreviewed: awaits a reader whose language it is.
"""

from experiments.check_words.words import DIGITS, Asked, CheckWords

WORDS = CheckWords(
    digit=Asked("Welk cijfer hebt u gezien?", DIGITS),
    direction=Asked(
        "In welke richting bewogen de stippen?", ("naar links", "naar rechts", "naar boven", "naar beneden")
    ),
    shape=Asked("Welke vorm hebt u gezien?", ("cirkel", "vierkant", "driehoek", "kruis")),
    first_blink=Asked("Welke knippering kwam eerst?", ("de hele (de ogen gingen dicht)", "de halve")),
    first_eye=Asked("Welk oog ging het eerst dicht, van u uit gezien?", ("het linker", "het rechter")),
)
