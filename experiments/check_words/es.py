"""Words of motion checks in Spanish.

Unreviewed: awaits a reader whose language it is.
"""

from experiments.check_words.words import DIGITS, Asked, CheckWords

WORDS = CheckWords(
    digit=Asked("¿Qué cifra ha visto?", DIGITS),
    direction=Asked(
        "¿Hacia dónde se han movido los puntos?",
        ("hacia la izquierda", "hacia la derecha", "hacia arriba", "hacia abajo"),
    ),
    shape=Asked("¿Qué forma ha visto?", ("círculo", "cuadrado", "triángulo", "cruz")),
    first_blink=Asked(
        "¿Qué parpadeo ha sido el primero?", ("el completo (los ojos se han cerrado)", "el parcial")
    ),
    first_eye=Asked(
        "¿Qué ojo se ha cerrado primero, desde su punto de vista?", ("el de la izquierda", "el de la derecha")
    ),
)
