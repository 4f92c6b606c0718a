"""Words of motion checks in English."""

from experiments.check_words.words import DIGITS, Asked, CheckWords

WORDS = CheckWords(
    digit=Asked("Which digit did you see?", DIGITS),
    direction=Asked("Which way did the dots move?", ("left", "right", "up", "down")),
    shape=Asked("Which shape did you see?", ("circle", "square", "triangle", "cross")),
    first_blink=Asked("Which blink came first?", ("the full one (the eyes closed)", "the half one")),
    first_eye=Asked("Which eye closed first, as you saw it?", ("the left one", "the right one")),
)
