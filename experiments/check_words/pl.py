"""Words of motion checks in Polish.

Unreviewed: awaits a reader whose language it is.
"""

from experiments.check_words.words import DIGITS, Asked, CheckWords

WORDS = CheckWords(
    digit=Asked("Jaka cyfra była widoczna?", DIGITS),
    direction=Asked("W którą stronę poruszały się punkty?", ("w lewo", "w prawo", "w górę", "w dół")),
    shape=Asked("Jaki kształt był widoczny?", ("koło", "kwadrat", "trójkąt", "krzyż")),
    first_blink=Asked("Które mrugnięcie było pierwsze?", ("pełne (oczy się zamknęły)", "połowiczne")),
    first_eye=Asked("Które oko zamknęło się najpierw, patrząc od Pani lub Pana strony?", ("lewe", "prawe")),
)
