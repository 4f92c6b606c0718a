"""Motion checks: short clips whose answer shows in motion alone, and what is asked about each kind."""

from dataclasses import dataclass
from typing import Literal

from experiments.base import Translated

CheckName = Literal["digit", "direction", "shape", "first_blink", "first_eye"]
CHECK_CELL = ""
"""The cell of a check's clip where clips are stored by cell: no design has a cell without a name."""


@dataclass(frozen=True)
class CheckKind:
    """What is asked about the clips of one kind of check.

    Attributes
    ----------
    question, choices: by language; answers are numbered from 1 in the order of the choices.
    own_look: True where the clip shows the study's own character, else it shows random dots.
    """

    question: Translated
    choices: tuple[Translated, ...]
    own_look: bool = False


CHECK_KINDS: dict[CheckName, CheckKind] = {
    "digit": CheckKind(
        {"en": "Which digit did you see?", "de": "Welche Ziffer haben Sie gesehen?"},
        tuple({"en": str(digit), "de": str(digit)} for digit in range(1, 10)),
    ),
    "direction": CheckKind(
        {"en": "Which way did the dots move?", "de": "Wohin haben sich die Punkte bewegt?"},
        (
            {"en": "left", "de": "nach links"},
            {"en": "right", "de": "nach rechts"},
            {"en": "up", "de": "nach oben"},
            {"en": "down", "de": "nach unten"},
        ),
    ),
    "shape": CheckKind(
        {"en": "Which shape did you see?", "de": "Welche Form haben Sie gesehen?"},
        (
            {"en": "circle", "de": "Kreis"},
            {"en": "square", "de": "Quadrat"},
            {"en": "triangle", "de": "Dreieck"},
            {"en": "cross", "de": "Kreuz"},
        ),
    ),
    "first_blink": CheckKind(
        {"en": "Which blink came first?", "de": "Welcher Lidschlag kam zuerst?"},
        (
            {"en": "the full one (the eyes closed)", "de": "der ganze (die Augen schlossen sich)"},
            {"en": "the half one", "de": "der halbe"},
        ),
        own_look=True,
    ),
    "first_eye": CheckKind(
        {
            "en": "Which eye closed first, as you saw it?",
            "de": "Welches Auge schloss sich zuerst, von Ihnen aus gesehen?",
        },
        ({"en": "the left one", "de": "das linke"}, {"en": "the right one", "de": "das rechte"}),
        own_look=True,
    ),
}
