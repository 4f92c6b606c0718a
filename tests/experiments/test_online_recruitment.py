"""The switch for online recruitment: what it adds to a run, and what the consent must mention."""

from collections import Counter
from itertools import product

import pytest

from experiments.assignment.order import attention_by_block, motion_checks_by_block, with_checks
from experiments.checks import WORDS as CHECK_WORDS
from experiments.declaration.experiment import Experiment
from experiments.errors import InputError
from experiments.kinds import KINDS
from experiments.load import load_experiment, parse_experiment
from experiments.wording import SENTENCES, mentions_flicker
from tests.helpers.studies import SHORT

FLICKERING = SHORT.replace('"Do you agree?"', '"Some clips flicker. Do you agree?"').replace(
    '"Einverstanden?"', '"Einige Clips flimmern. Einverstanden?"'
)


def parsed(switch: bool, attention: int, motion: int, repeats: int) -> Experiment:
    text = FLICKERING.replace("[attention]\nper_block = 1", f"[attention]\nper_block = {attention}")
    text = text.replace('order = "alternating"', f'order = "alternating"\nrepeats = {repeats}')
    added = f"[evidence]\nonline_recruitment = {str(switch).lower()}\n\n"
    added += f"[evidence.motion_checks]\nper_block = {motion}\n\n"
    return parse_experiment(text.replace("[trial]\n", f"{added}[trial]\n", 1))


@pytest.mark.parametrize(("attention", "motion", "repeats"), list(product((0, 1, 2), (0, 1, 2), (1, 2, 3))))
def test_the_switch_adds_what_is_missing_to_two_motion_checks_and_one_question(
    attention: int, motion: int, repeats: int
) -> None:
    """In the counts and in a run's trials, in every number of blocks."""
    for switch in (False, True):
        experiment = parsed(switch, attention, motion, repeats)
        blocks = 2 * repeats
        questions, clips = attention_by_block(experiment), motion_checks_by_block(experiment)
        assert sum(questions) == max(attention * blocks, switch * 1)
        assert sum(clips) == max(motion * blocks, switch * 2)
        assert max(clips) - min(clips) <= 1
        trials = KINDS["clip_rating"].assign(experiment, 7, 0)
        counted = Counter(trial.kind for trial in with_checks(experiment, trials, 7, 24))
        assert (counted["attention"], counted["check"]) == (sum(questions), sum(clips))


def test_without_the_switch_the_order_of_trials_stays_as_it_was() -> None:
    """The switch draws nothing from the run's seed where it adds nothing."""
    runs = [KINDS["clip_rating"].assign(parsed(switch, 1, 1, 1), 7, 0) for switch in (False, True)]
    assert runs[0] == runs[1]


@pytest.mark.parametrize("name", ["exp1", "exp2", "exp3"])
def test_the_papers_experiments_stay_as_they_were_run(name: str) -> None:
    experiment = load_experiment(name)
    assert not experiment.evidence.online_recruitment
    assert not any((*attention_by_block(experiment), *motion_checks_by_block(experiment)))


def test_the_switch_needs_a_consent_that_mentions_flicker_in_every_language() -> None:
    text = SHORT.replace("[trial]\n", "[evidence]\nonline_recruitment = true\n\n[trial]\n", 1)
    with pytest.raises(InputError, match=r"texts\.en\.consent.*flicker"):
        parse_experiment(text)
    with pytest.raises(InputError, match=r"texts\.de\.consent.*flimmer"):
        parse_experiment(text.replace('"Do you agree?"', '"Some clips flicker. Do you agree?"'))


def test_every_language_has_a_sentence_that_mentions_flicker() -> None:
    assert set(SENTENCES) >= set(CHECK_WORDS)
    assert all(mentions_flicker(sentence, language) for language, sentence in SENTENCES.items())


@pytest.mark.parametrize(
    ("language", "text"),
    [
        ("en", "You will see blinks of a face. Do you agree?"),
        ("de", "Sie sehen Lidschläge und blinzelnde Gesichter."),
        ("es", "Verá parpadeos de una cara."),
        ("fr", "Vous verrez des clignements d’yeux."),
        ("it", "Vedrà battiti di ciglia; il volto ammicca."),
        ("nl", "U ziet gezichten die met de ogen knipperen."),
        ("pl", "Zobaczy Pan mrugnięcia twarzy."),
        ("pt", "Verá o piscar de um rosto."),
        ("ja", "まばたきの映像を評価します。"),
        ("zh", "您将看到眨眼的短片。"),
        ("ar", "سترى رمشات وجه."),
    ],
)
def test_a_consent_about_blinks_does_not_count_as_one_about_flicker(language: str, text: str) -> None:
    assert not mentions_flicker(text, language)
