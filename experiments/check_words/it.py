"""Words of motion checks in Italian.

Unreviewed: awaits a reader whose language it is.
"""

from experiments.check_words.words import DIGITS, Asked, CheckWords

WORDS = CheckWords(
    digit=Asked("Quale cifra ha visto?", DIGITS),
    direction=Asked(
        "In quale direzione si sono mossi i punti?",
        ("verso sinistra", "verso destra", "verso l’alto", "verso il basso"),
    ),
    shape=Asked("Quale forma ha visto?", ("cerchio", "quadrato", "triangolo", "croce")),
    first_blink=Asked(
        "Quale battito di ciglia è venuto per primo?",
        ("quello completo (gli occhi si sono chiusi)", "quello a metà"),
    ),
    first_eye=Asked(
        "Quale occhio si è chiuso per primo, dal Suo punto di vista?",
        ("quello a sinistra", "quello a destra"),
    ),
)
