"""Words of motion checks in Portuguese.

Unreviewed: awaits a reader whose language it is.
"""

from experiments.check_words.words import DIGITS, Asked, CheckWords

WORDS = CheckWords(
    digit=Asked("Que algarismo viu?", DIGITS),
    direction=Asked(
        "Em que direção se moveram os pontos?",
        ("para a esquerda", "para a direita", "para cima", "para baixo"),
    ),
    shape=Asked("Que forma viu?", ("círculo", "quadrado", "triângulo", "cruz")),
    first_blink=Asked(
        "Que piscar de olhos veio primeiro?", ("o completo (os olhos fecharam-se)", "o parcial")
    ),
    first_eye=Asked("Que olho se fechou primeiro, do seu ponto de vista?", ("o da esquerda", "o da direita")),
)
