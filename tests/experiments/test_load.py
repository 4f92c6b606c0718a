import json
import re

import pytest

from experiments.declaration.clip_rating import clip_rating_of
from experiments.declaration.experiment import Experiment
from experiments.errors import InputError
from experiments.load import (
    FOLDER,
    SHIPPED,
    DefinitionError,
    load_experiment,
    load_stored,
    locate,
    parse_experiment,
)
from experiments.rules import ScreenFormAnswer
from experiments.schema.canonical import definition_sha256
from experiments.schema.stored import FORMAT
from experiments.wording import unlisted
from tests.helpers.studies import SHORT

EXP1 = locate("exp1").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("per_cell", "per_cel", 67, "unknown key 'per_cel'; did you mean 'per_cell'?"),
        ("motion_blur = false", "motion_blr = false", 50, "did you mean 'motion_blur'?"),
        ('rule = "incomplete"', 'rule = "incomplet"', 99, "did you mean 'incomplete'?"),
        ("more_than = 0.2", "mor_than = 0.2", 103, "did you mean 'more_than'?"),
        ("expected_seconds = 7.3", "expected_seconds = -1", 80, "expected more than 0, got -1"),
        ("maximum = 120", "maximun = 120", 127, "did you mean 'maximum'?"),
        (
            'own_per = ["profile"]',
            'own_per = ["profil"]',
            68,
            "no factor is called 'profil'; did you mean 'profile'?",
        ),
        ("title =", "title ", 3, "not valid TOML"),
        ('name = "cartoon"', 'name = "photorealistic"', None, "'photorealistic' is used twice"),
        ('name = "blur"', 'name = "response"', None, "has the name of a ratings column"),
        ('profile = "phases"', 'profile = "phasse"', None, "expected one of real, phases"),
    ],
)
def test_a_wrong_definition_names_line_and_remedy(old: str, new: str, line: int | None, message: str) -> None:
    assert old in EXP1
    with pytest.raises(DefinitionError) as caught:
        parse_experiment(EXP1.replace(old, new, 1), "mine.toml")
    problem = caught.value.problems[0]
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    if line is not None:
        assert problem.line == line


def test_every_problem_is_listed() -> None:
    text = EXP1.replace("per_cell", "per_cel").replace("seconds = 7.3", "seconds = 0")
    with pytest.raises(DefinitionError) as caught:
        parse_experiment(text)
    assert len(caught.value.problems) == 3  # the misspelling, the key it left missing, the zero


def test_an_unknown_experiment_is_refused_with_the_nearest() -> None:
    with pytest.raises(InputError, match=r"'robots'; expected one of: .*, or the path of a TOML file"):
        load_experiment("robots")
    with pytest.raises(InputError, match=r"no experiment 'exp11'; did you mean 'exp1'\?"):
        load_experiment("exp11")
    with pytest.raises(
        InputError, match=r"'exp9'; did you mean 'exp3'\? Expected one of: exp1, exp2, exp3, pairs"
    ):
        load_experiment("exp9")
    with pytest.raises(InputError, match=r"no experiment 'pairs'; did you mean 'pairs-demo'\?"):
        load_experiment("pairs")
    with pytest.raises(
        InputError, match=r"^no experiment 'motion'; expected .* browser, .* downloads .* downloaded file$"
    ):
        load_experiment("motion")
    with pytest.raises(InputError, match=r"^no experiment 'in/motion'; expected .* path of a TOML file$"):
        load_experiment("in/motion")


def test_a_file_given_without_its_ending_is_named(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "motion.toml").write_text("")
    with pytest.raises(
        InputError, match=r"^no experiment 'motion'; there is a file motion.toml here; .*: motion.toml$"
    ):
        load_experiment("motion")


def test_a_missing_file_is_named() -> None:
    with pytest.raises(InputError, match=r"no file missing\.toml"):
        load_experiment("missing.toml")


def test_the_hash_is_of_the_meaning_not_the_spelling() -> None:
    commented = "# a remark\n" + EXP1
    assert definition_sha256(parse_experiment(commented)) == definition_sha256(load_experiment("exp1"))
    changed = EXP1.replace("per_cell = 20", "per_cell = 19")
    assert definition_sha256(parse_experiment(changed)) != definition_sha256(load_experiment("exp1"))


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_experiments_speak_every_language_they_list(name: str) -> None:
    experiment = load_experiment(name)
    for language in experiment.languages:
        assert clip_rating_of(experiment).scale.question[language]
        for form in experiment.forms:
            assert form.title[language]
            assert all(field.label[language] for field in form.fields)


SCREENED = """
[[screening]]
rule = "form_answer"
form = "{form}"
field = "{field}"
{condition}
"""


def screened(form: str = "demographics", field: str = "age", condition: str = "above = 80") -> str:
    rule = SCREENED.format(form=form, field=field, condition=condition)
    return EXP1.replace("[[exclusions]]", rule + "\n[[exclusions]]", 1)


def test_screening_rules_are_part_of_the_declaration() -> None:
    rule = parse_experiment(screened()).screening[0]
    assert isinstance(rule, ScreenFormAnswer)
    assert [rule.screens_out(age) for age in (18, 80, 81)] == [False, False, True]
    both = ScreenFormAnswer(form="a", field="b", refused=("x", "y"))
    assert [both.screens_out(given) for given in ("x", ["z", "y"], "z", ["z"], None)] == [
        True,
        True,
        False,
        False,
        False,
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (screened(form="demografics"), "no form is called 'demografics'; did you mean 'demographics'?"),
        (screened(field="agee"), "has no field 'agee'; did you mean 'age'?"),
        (screened(condition='refused = ["90"]'), "'age' is a number: use `below` or `above`"),
        (screened(condition=""), "'age' is a number: use `below` or `above`"),
        (screened(field="vision"), "'vision' is a choice: use `refused`"),
        (screened(field="vision", condition='refused = ["blnd"]'), "'vision' has no option 'blnd'"),
        (screened(condition="abov = 80"), "unknown key 'abov'; did you mean 'above'?"),
    ],
)
def test_a_screening_rule_must_fit_the_forms(text: str, message: str) -> None:
    with pytest.raises(DefinitionError) as caught:
        parse_experiment(text)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_screening_rule_changes_the_hash() -> None:
    assert definition_sha256(parse_experiment(screened())) != definition_sha256(load_experiment("exp1"))


def test_a_file_that_is_not_text_is_reported_in_one_line(tmp_path) -> None:
    file = tmp_path / "study.toml"
    file.write_bytes(b"\x91\x00\xff")
    with pytest.raises(InputError, match=r"study\.toml is not UTF-8 text .*; save it as UTF-8"):
        load_experiment(str(file))


@pytest.mark.parametrize(
    "name", ["pairs-demo", "sliders_demo", "dcr-demo", "threshold-demo", "plane-demo", "faces-demo"]
)
def test_demos_are_found_by_the_names_of_their_file_and_of_the_experiment(name: str) -> None:
    by_name, file = load_experiment(name), name.replace("_", "-")
    assert load_experiment(by_name.name) == by_name == load_experiment(str(FOLDER / f"{file}.toml"))
    with pytest.raises(InputError, match=r"no experiment 'pairs_dmo'; did you mean 'pairs-demo'\?"):
        load_experiment("pairs_dmo")


def test_texts_that_nobody_is_offered_are_named() -> None:
    """`unlisted` is what the builder's notes and those of the check say."""
    assert unlisted(parse_experiment(EXP1), ("en", "de")) == ""
    alone = parse_experiment(EXP1.replace('languages = ["en", "de"]', 'languages = ["en"]'))
    assert unlisted(alone, alone.languages).startswith("Texts in de are never shown, such as that of ")
    # Kept in a database it holds its defaults too, which nobody wrote.
    in_english = re.sub(
        r', de = "[^"]*"', "", SHORT.replace('languages = ["en", "de"]', 'languages = ["en"]')
    )
    short = parse_experiment(in_english)
    stored = Experiment.model_validate(short.model_dump(mode="json"))
    assert (stored.languages, unlisted(stored, stored.languages)) == (("en",), "")


def test_a_text_without_the_first_language_is_refused() -> None:
    """A question declared in German alone was accepted; participants in English saw it in no language."""
    text = EXP1.replace('languages = ["en", "de"]', 'languages = ["en"]')
    text = text.replace('en = "How natural was this blink?", ', "")
    with pytest.raises(DefinitionError) as caught:
        parse_experiment(text, "mine.toml")
    assert str(caught.value) == (
        "mine.toml: line 85: trial.scale.question: expected a text in en, the first of languages, got only "
        "de, and languages does not list de; add en to the text, or correct languages"
    )
    # What was collected by it is analyzed, and what a database holds is read.
    experiment = parse_experiment(text, has_data=True)
    assert load_stored(json.loads(experiment.model_dump_json()), FORMAT) == experiment


def test_texts_without_the_first_language_are_counted() -> None:
    text = EXP1.replace('languages = ["en", "de"]', 'languages = ["fr"]').replace("[texts.de]", "[texts.fr]")
    with pytest.raises(DefinitionError, match=r"got only en, de, .* \(\d+ more lack it\)"):
        parse_experiment(text)
