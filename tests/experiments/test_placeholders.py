"""Placeholders of templates in any text that participants read, and what looks like one and is none."""

import json
import re
from pathlib import Path

import pytest

from experiments.load import locate, parse_experiment
from experiments.wording import unfilled_texts, untranslated
from tests.helpers.studies import SHORT

BANK = Path(__file__).parents[2] / "frontend/src/admin/builder/bank.ts"
SHIPPED = ("exp1", "exp2", "exp3", "faces-demo", "pairs-demo", "threshold-demo", "sliders-demo", "dcr-demo")


def with_consent(text: str, language: str = "en") -> str:
    first = "Do you agree?" if language == "en" else "Einverstanden?"
    return SHORT.replace(json.dumps(first, ensure_ascii=False), json.dumps(text, ensure_ascii=False))


@pytest.mark.parametrize(
    "mark",
    [
        "[Title]", "[topic]", "[name, institution, e-mail]", "[Titel]", "[Name des Projekts]", "[título]",
        "[your name here]", "[TBA]", "［題名］", "{{title}}", "${name}", "<<NAME>>", "TODO", "XXX", "TBD",
        "Lorem ipsum", "[minutes] ", "[Number of trials]",
    ],
)  # fmt: skip
@pytest.mark.parametrize("language", ["en", "de"])
def test_marks_that_nobody_filled_in_are_found_in_every_language(mark: str, language: str) -> None:
    [found] = unfilled_texts(parse_experiment(with_consent(f"# A study\n\nOf {mark}: yes.", language)))
    assert found.certain
    assert (found.path, found.language, found.marks) == (
        f"texts.{language}.consent",
        language,
        (mark.strip(),),
    )
    assert mark.strip() in str(found)


@pytest.mark.parametrize(
    "text",
    [
        "Write to [us](mailto:lab@example.org) or see [the page](https://example.org).",
        "Press [Space] or [F], [1] to [7], [←] and [Enter].",
        "He said [sic] so [...].",
        "`[Title]` is how a placeholder looks.",
        "- [ ] open\n- [x] done",
        "About 20 minutes, sampled at [0, 1].",
        "Above\n\n___\n\nbelow",
        "Comments [optional], other [please specify], ［任意］, Sonstiges [bitte angeben]",
        "As in [Smith et al., 2020], a device [e.g. a phone].",
    ],
)
def test_links_keys_and_quoted_marks_are_not_placeholders(text: str) -> None:
    assert unfilled_texts(parse_experiment(with_consent(text))) == []


@pytest.mark.parametrize("mark", ["{name}", "<name>", "XX", "____", "???"])
def test_marks_that_may_be_meant_as_they_are_do_not_block(mark: str) -> None:
    [found] = unfilled_texts(parse_experiment(with_consent(f"It takes {mark} minutes.")))
    assert (found.certain, found.marks) == (False, (mark,))


def test_questions_labels_and_titles_are_looked_at_too() -> None:
    text = SHORT.replace("How natural?", "How [adjective]?").replace("Glasses", "[Option]")
    text = text.replace('title = "A short study"', 'title = "[Title]"')
    assert [(found.path, found.where) for found in unfilled_texts(parse_experiment(text))] == [
        ("title", '"Title"'),
        ("trial.scale.question.en", '"Question" of "Scale" of "Trial"'),
        (
            "forms.1.fields.2.options.1.label.en",
            '"Label" of the answer glasses of the question glasses of the questionnaire about',
        ),
    ]


def test_a_language_that_nobody_is_offered_is_not_looked_at() -> None:
    text = with_consent("[Titel]", "de").replace('["en", "de"]', '["en"]')
    assert unfilled_texts(parse_experiment(text)) == []


def test_every_mark_of_the_consent_forms_that_come_with_the_builder_is_found() -> None:
    written = BANK.read_text(encoding="utf-8").partition("export const CONSENTS")[2]
    consents = re.findall(r"`(#[^`]*)`", written)
    assert len(consents) >= 4
    for consent in consents:
        [found] = unfilled_texts(parse_experiment(with_consent(consent)))
        assert set(found.marks) == set(re.findall(r"\[[^\]]+\]", consent))


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_studies_have_none(name: str) -> None:
    declared = parse_experiment(locate(name).read_text(encoding="utf-8"))
    assert unfilled_texts(declared) == []
    assert untranslated(declared) == {}


def test_texts_without_a_translation_are_named_by_language() -> None:
    missing = untranslated(parse_experiment(SHORT))
    assert list(missing) == ["de"]
    assert "forms.1.title" in missing["de"]
    assert "trial.scale.question" not in missing["de"]
