"""Rules of [[warnings.rules]]: careless responding in the last answers of a run, and the warning shown."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from statistics import median
from typing import Annotated, Literal

from pydantic import Field

from experiments.declaration.base import Declaration, Translated

# A rule of [[warnings.rules]] detects careless responding in the last answers of a run.
# A rule is a class: its keys, and a method that decides. The server calls it with each answer to a main
# trial, whatever the kind of trial.


@dataclass(frozen=True)
class GivenAnswer:
    """One answer to a main trial: as text that is equal for equal answers, and its response time in ms."""

    value: str
    rt: float | None


class Warns(Declaration):
    """A rule about careless answers: its method `lapses(given: Sequence[GivenAnswer]) -> bool` judges.

    Attributes
    ----------
    answers : int
        How many answers it receives, the latest last; with fewer it is not called.
    text : Translated
        The text that the participant then reads.
    """

    answers: int
    text: Translated


def follow_a_cycle(given: Sequence[GivenAnswer], length: int) -> bool:
    """True where every answer equals the one `length` answers before."""
    values = [one.value for one in given]
    return len(values) > length and values[length:] == values[:-length]


# Texts of the warnings in the languages of the page. They apply if a rule has no `text`.
# Only English is reviewed; the others await review by a native speaker.

HEADINGS = {
    "en": "A word in between",
    "de": "Ein Wort zwischendurch",
    "fr": "Un mot en passant",
    "es": "Un breve aviso",
    "it": "Una breve nota",
    "nl": "Even tussendoor",
    "pl": "Krótka uwaga",
    "pt": "Uma breve nota",
    "ja": "ひとこと",
    "zh": "温馨提示",
    "ar": "كلمة قصيرة",
}
SAME_ANSWER = {
    "en": "Your last answers were all the same. If that is how you saw the clips, all is well. If your "
    "thoughts have wandered: take a short break, and then look at each clip with fresh eyes.",
    "de": "Ihre letzten Antworten waren alle gleich. Wenn Sie die Clips so gesehen haben, ist alles gut. "
    "Wenn "
    "Sie mit den Gedanken woanders waren: Machen Sie eine kurze Pause, und sehen Sie dann jeden "
    "Clip neu an.",
    "fr": "Vos dernières réponses étaient toutes identiques. Si c’est ainsi que vous avez vu les clips, "
    "tout "
    "va bien. Si vous pensiez à autre chose : faites une courte pause, puis regardez chaque clip à nouveau "
    "avec attention.",
    "es": "Sus últimas respuestas han sido todas iguales. Si así ha visto los clips, todo está bien. Si "
    "estaba pensando en otra cosa: haga una breve pausa y después mire cada clip con atención.",
    "it": "Le Sue ultime risposte erano tutte uguali. Se ha visto così i filmati, va tutto bene. Se stava "
    "pensando ad altro: faccia una breve pausa e poi guardi di nuovo ogni filmato con attenzione.",
    "nl": "Uw laatste antwoorden waren allemaal hetzelfde. Als u de clips zo hebt gezien, is alles goed. "
    "Als "
    "uw gedachten zijn afgedwaald: neem een korte pauze en bekijk daarna elke clip met nieuwe aandacht.",
    "pl": "Ostatnie odpowiedzi były wszystkie takie same. Jeśli tak widziane były klipy, wszystko jest w "
    "porządku. Jeśli uwaga odbiegła gdzie indziej: prosimy o krótką przerwę, a potem o uważne obejrzenie "
    "każdego klipu.",
    "pt": "As suas últimas respostas foram todas iguais. Se foi assim que viu os vídeos, está tudo bem. Se "
    "estava a pensar noutra coisa: faça uma pequena pausa e depois veja cada vídeo com nova atenção.",
    "ja": "最近の回答がすべて同じでした。映像がそのように見えたのであれば問題ありません。"
    "ほかのことを考えていた場合は、少し休んでから、映像を一つずつ改めてご覧ください。",
    "zh": "您最近的回答全部相同。如果您看到的短片确实如此，那没有问题。"
    "如果您刚才走神了，请稍事休息，然后重新认真观看每段短片。",
    "ar": "كانت إجاباتك الأخيرة كلها متشابهة. إذا كانت المقاطع قد بدت لك كذلك فلا بأس. وإذا كان ذهنك قد "
    "شرد: "
    "خذ استراحة قصيرة، ثم شاهد كل مقطع من جديد بانتباه.",
}
REPEATED_PATTERN = {
    "en": "Your last answers repeat a pattern. Please answer each clip by what you see in it; there is no "
    "hurry, and a short break does no harm.",
    "de": "Ihre letzten Antworten folgen einem Muster. Bitte beantworten Sie jeden Clip nach dem, was Sie "
    "darin sehen; es eilt nicht, und eine kurze Pause schadet nicht.",
    "fr": "Vos dernières réponses suivent un motif qui se répète. Répondez à chaque clip d’après ce que "
    "vous "
    "y voyez ; rien ne presse, et une courte pause ne fait pas de mal.",
    "es": "Sus últimas respuestas repiten un patrón. Responda a cada clip según lo que vea en él; no hay "
    "prisa, y una breve pausa no hace daño.",
    "it": "Le Sue ultime risposte seguono uno schema che si ripete. Risponda a ogni filmato secondo ciò che "
    "vede; non c’è fretta, e una breve pausa non fa male.",
    "nl": "Uw laatste antwoorden volgen een vast patroon. Beantwoord elke clip naar wat u erin ziet; er is "
    "geen haast, en een korte pauze kan geen kwaad.",
    "pl": "Ostatnie odpowiedzi powtarzają pewien wzór. Prosimy odpowiadać na każdy klip według tego, co w "
    "nim "
    "widać; nie ma pośpiechu, a krótka przerwa nie zaszkodzi.",
    "pt": "As suas últimas respostas repetem um padrão. Responda a cada vídeo pelo que vê nele; não há "
    "pressa, "
    "e uma pequena pausa não faz mal.",
    "ja": "最近の回答が一定のパターンの繰り返しになっています。映像ごとに、見たとおりにお答えください。"
    "急ぐ必要はありません。少し休んでもかまいません。",
    "zh": "您最近的回答呈现重复的规律。请根据每段短片中看到的内容作答；不必着急，稍作休息也无妨。",
    "ar": "إجاباتك الأخيرة تتبع نمطًا متكررًا. يُرجى الإجابة عن كل مقطع بحسب ما تراه فيه؛ لا داعي للعجلة، "
    "ولا ضرر في استراحة قصيرة.",
}
FAST_ANSWERS = {
    "en": "Your last answers came very fast. Please watch each clip to its end, and then answer by your "
    "impression; nobody counts the seconds.",
    "de": "Ihre letzten Antworten kamen sehr schnell. Bitte sehen Sie jeden Clip bis zum Ende an, und "
    "antworten Sie dann nach Ihrem Eindruck; niemand zählt die Sekunden.",
    "fr": "Vos dernières réponses étaient très rapides. Regardez chaque clip jusqu’à la fin, puis répondez "
    "selon votre impression ; personne ne compte les secondes.",
    "es": "Sus últimas respuestas han sido muy rápidas. Vea cada clip hasta el final y responda después "
    "según "
    "su impresión; nadie cuenta los segundos.",
    "it": "Le Sue ultime risposte sono state molto rapide. Guardi ogni filmato fino alla fine e poi "
    "risponda "
    "secondo la Sua impressione; nessuno conta i secondi.",
    "nl": "Uw laatste antwoorden kwamen erg snel. Bekijk elke clip tot het einde en antwoord dan naar uw "
    "indruk; niemand telt de seconden.",
    "pl": "Ostatnie odpowiedzi padały bardzo szybko. Prosimy obejrzeć każdy klip do końca, a potem "
    "odpowiedzieć zgodnie ze swoim wrażeniem; nikt nie liczy sekund.",
    "pt": "As suas últimas respostas foram muito rápidas. Veja cada vídeo até ao fim e responda depois "
    "segundo a sua impressão; ninguém conta os segundos.",
    "ja": "最近の回答がとても速くなっています。"
    "それぞれの映像を最後までご覧になってから、印象のとおりにお答えください。"
    "時間を競うものではありません。",
    "zh": "您最近的回答非常快。请将每段短片看完，再根据您的印象作答；没有人在计时。",
    "ar": "جاءت إجاباتك الأخيرة سريعة جدًا. يُرجى مشاهدة كل مقطع حتى نهايته، ثم الإجابة بحسب انطباعك؛ "
    "لا أحد يعدّ الثواني.",
}


def in_every_language(words: dict[str, str]) -> dict[str, str]:
    """The words as Markdown, each under the heading of its language."""
    return {tag: f"# {HEADINGS[tag]}\n\n{text}" for tag, text in words.items()}


# Warning about answers that are too fast.


class WarnFast(Warns):
    """Warn if the median response time of the last `answers` main trials is below `below_ms`."""

    rule: Literal["fast_answers"] = "fast_answers"
    """The name of this rule."""
    answers: Annotated[int, Field(ge=5, le=100)] = 10
    """Number of answers from which the median is computed."""
    below_ms: Annotated[float, Field(gt=0)] = 250.0
    """Median response time below which the warning is shown, in ms from the end of the clip."""
    text: Translated = Field(default_factory=partial(in_every_language, FAST_ANSWERS))
    """Markdown of the warning, in every language."""

    def lapses(self, given: Sequence[GivenAnswer]) -> bool:
        """True where the median lies below; answers without a time, as after a reload, do not count."""
        times = [one.rt for one in given if one.rt is not None]
        return len(times) > len(given) // 2 and median(times) < self.below_ms


# Warning of answers that repeat in a cycle.


class WarnPattern(Warns):
    """Warn if the last `answers` main trials repeat a pattern of two to `longest` answers."""

    rule: Literal["repeated_pattern"] = "repeated_pattern"
    """The name of this rule."""
    answers: Annotated[int, Field(ge=8, le=100)] = 20
    """Number of consecutive answers that follow the pattern."""
    longest: Annotated[int, Field(ge=2, le=10)] = 4
    """Length of the longest pattern to detect; 1, 2, 3, 1, 2, 3 has length 3."""
    text: Translated = Field(default_factory=partial(in_every_language, REPEATED_PATTERN))
    """Markdown of the warning, in every language."""

    def lapses(self, given: Sequence[GivenAnswer]) -> bool:
        """True where they follow a cycle of some length, and are not all equal."""
        if follow_a_cycle(given, 1):
            return False
        return any(follow_a_cycle(given, length) for length in range(2, self.longest + 1))


# Warning about identical answers.


class WarnSameAnswer(Warns):
    """Warn if all of the last `answers` main trials have the same answer."""

    rule: Literal["same_answer"] = "same_answer"
    """The name of this rule."""
    answers: Annotated[int, Field(ge=5, le=100)] = 20
    """Identical answers in a row. With two possible answers, 20 identical answers occur by chance in 1 of
    5,000 visits of 100 trials."""
    text: Translated = Field(default_factory=partial(in_every_language, SAME_ANSWER))
    """Markdown of the warning, in every language."""

    def lapses(self, given: Sequence[GivenAnswer]) -> bool:
        """True where all are equal."""
        return follow_a_cycle(given, 1)
