"""Whether consent mentions flicker, which some people are sensitive to and must know before they agree."""

import re
from typing import TYPE_CHECKING

from experiments.assignment.checks import motion_checks_by_block

if TYPE_CHECKING:
    from experiments.definition import Experiment

WORDS = {
    "ar": r"وميض|وماض|تومض|يومض|تخفق|صرع",
    "de": r"flacker|flicker|flimmer|blitz|photosens|fotosens|lichtempfindlich|epilep",
    "en": r"flicker|flash|strob|photosens|epilep",
    "es": r"destell|titil|centelle|parpade(?:an|antes)|fotosens|epilep|epilép",
    "fr": r"scintill|clignot|papillot|vacill|photosens|épilep",
    "it": r"sfarfall|lampegg|tremol|intermitten|fotosens|epiless|epilett",
    "ja": r"ちらつ|点滅|明滅|フリッカ|フラッシュ|光過敏|光感受性|てんかん",
    "nl": r"flikker|flits|fotosens|lichtgevoelig|epilep",
    "pl": r"migot|migoc|migaj|błysk|fotosens|światłoczu|wrażliw\w* na światło|epilep|padacz",
    "pt": r"cintil|tremel|bruxule|tremul|lampej|piscantes|fotossens|epilep|epilép",
    "zh": r"闪烁|闪光|闪动|频闪|光敏|癫痫|閃爍|閃光|癲癇",
}
"""Parts of words by which a consent mentions flicker, in each language of the page; none of them is about
blinking."""
SENTENCES = {
    "ar": "تعرض بعض المقاطع القصيرة نقاطًا تومض بسرعة.",
    "de": "Einige kurze Clips zeigen flimmernde Punkte.",
    "en": "A few short clips show flickering dots.",
    "es": "Algunos clips breves muestran puntos que titilan.",
    "fr": "Quelques courts clips montrent des points qui scintillent.",
    "it": "Alcune brevi clip mostrano punti che sfarfallano.",
    "ja": "いくつかの短い映像では、点がちらつきます。",
    "nl": "Enkele korte clips tonen flikkerende stippen.",
    "pl": "Niektóre krótkie klipy pokazują migoczące kropki.",
    "pt": "Alguns clipes curtos mostram pontos que cintilam.",
    "zh": "部分短片会显示闪烁的圆点。",
}
"""A sentence for a consent; English and German are read by the authors, the others await a reader."""


def mentions_flicker(text: str, language: str) -> bool:
    """Whether a text mentions flicker; True in languages whose words are not known: nothing can be said."""
    known = WORDS.get(language.partition("-")[0].lower())
    return known is None or re.search(known, text, re.IGNORECASE) is not None


def silent_on_flicker(experiment: "Experiment") -> list[str]:
    """Languages of a study with motion checks of dots whose consent does not mention flicker."""
    if not any(motion_checks_by_block(experiment)):
        return []
    if all(kind.startswith("first_") for kind in experiment.evidence.motion_checks.kinds):
        return []
    return [
        language
        for language in experiment.languages
        if not mentions_flicker(experiment.texts[language].consent, language)
    ]


def suggested_sentence(language: str) -> str:
    """A sentence that a consent in this language can use."""
    return SENTENCES.get(language.partition("-")[0].lower(), SENTENCES["en"])
