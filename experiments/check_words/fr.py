"""Words of motion checks in French.

Unreviewed: awaits a reader whose language it is.
"""

from experiments.check_words.words import DIGITS, Asked, CheckWords

WORDS = CheckWords(
    digit=Asked("Quel chiffre avez-vous vu ?", DIGITS),
    direction=Asked(
        "Dans quelle direction les points se sont-ils déplacés ?",
        ("vers la gauche", "vers la droite", "vers le haut", "vers le bas"),
    ),
    shape=Asked("Quelle forme avez-vous vue ?", ("cercle", "carré", "triangle", "croix")),
    first_blink=Asked(
        "Quel clignement est venu en premier ?",
        ("le clignement complet (les yeux se sont fermés)", "le demi-clignement"),
    ),
    first_eye=Asked(
        "Quel œil s’est fermé en premier, de votre point de vue ?", ("celui de gauche", "celui de droite")
    ),
)
