"""Words of motion checks in German."""

from experiments.check_words.words import DIGITS, Asked, CheckWords

WORDS = CheckWords(
    digit=Asked("Welche Ziffer haben Sie gesehen?", DIGITS),
    direction=Asked(
        "Wohin haben sich die Punkte bewegt?", ("nach links", "nach rechts", "nach oben", "nach unten")
    ),
    shape=Asked("Welche Form haben Sie gesehen?", ("Kreis", "Quadrat", "Dreieck", "Kreuz")),
    first_blink=Asked("Welcher Lidschlag kam zuerst?", ("der ganze (die Augen schlossen sich)", "der halbe")),
    first_eye=Asked("Welches Auge schloss sich zuerst, von Ihnen aus gesehen?", ("das linke", "das rechte")),
)
