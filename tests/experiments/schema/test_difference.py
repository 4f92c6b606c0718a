import pytest

from experiments.kinds import KINDS
from experiments.load import load_experiment, locate, parse_experiment
from experiments.schema.difference import Change, changes_what_is_measured, difference
from experiments.schema.effects import EFFECTS, effect_of, effects_with, keys, paths

TEXT = locate("exp1").read_text(encoding="utf-8")


def edited(*pairs: tuple[str, str]) -> list[Change]:
    text = TEXT
    for before, after in pairs:
        assert before in text, before
        text = text.replace(before, after, 1)
    return difference(load_experiment("exp1"), parse_experiment(text))


def test_every_key_says_what_an_edit_of_it_does() -> None:
    # What other kinds declare below [trial] is theirs.
    others = {path for path in paths() if path.startswith("trial.")}
    for kind in KINDS.values():
        declared = paths() - others | paths(kind.declaration, "trial.")
        assert {path for path in declared if effect_of(path, effects_with(kind.effects)) is None} == set()


def test_no_entry_is_left_from_a_key_that_is_gone() -> None:
    assert set(EFFECTS) - {key.path for key in keys()} == set()


def test_a_new_key_is_covered_by_no_entry() -> None:
    assert effect_of("brand_new") is None
    assert effect_of("display.brand_new") is None
    assert effect_of("trial.brand_new") is None


def test_nothing_changed_is_not_a_difference() -> None:
    assert edited() == []
    assert edited(("participants = ", "# a comment\nparticipants = ")) == []


@pytest.mark.parametrize(
    ("before", "after", "path", "effect"),
    [
        ("maximum = 7", "maximum = 5", "trial.scale.maximum", "measured"),
        ("How natural", "How lifelike", "trial.scale.question.en", "measured"),
        ("trials = 6", "trials = 8", "practice.trials", "measured"),
        ('kind = "clip_rating"', 'kind = "clip_rating"\nviews = 2', "trial.views", "measured"),
        ("inter_ocular_mm = 60.0", "inter_ocular_mm = 62.0", "display.inter_ocular_mm", "measured"),
        ("Your age in years", "Your age", "forms.demographics.fields.age.label.en", "wording"),
        ("maximum = 120", "maximum = 99", "forms.demographics.fields.age.maximum", "measured"),
        ("# Thank you", "# Thanks", "texts.en.debrief", "wording"),
        ("participants = 32", "participants = 40", "participants", "wording"),
    ],
)
def test_an_edit_is_named_and_judged(before: str, after: str, path: str, effect: str) -> None:
    changes = edited((before, after))
    assert [(change.path, change.effect) for change in changes] == [(path, effect)]
    assert changes_what_is_measured(changes) == (effect == "measured")
    assert changes[0].before != changes[0].after


def test_what_is_measured_comes_first() -> None:
    changes = edited(("participants = 32", "participants = 40"), ("maximum = 7", "maximum = 5"))
    assert [change.effect for change in changes] == ["measured", "wording"]
    assert str(changes[0]) == "trial.scale.maximum: 7 becomes 5"


def test_a_level_added_changes_what_is_measured_and_its_label_does_not() -> None:
    old = load_experiment("exp3")
    text = locate("exp3").read_text(encoding="utf-8")
    labelled = parse_experiment(text.replace('label = "No motion"', 'label = "None"'))
    assert [str(change) for change in difference(old, labelled)] == [
        "factors.lower_lid.levels.none.label: No motion becomes None"
    ]
    extra = '[[factors.levels]]\nname = "more"\nlabel = "More"\n\n[exemplars]'
    more = difference(old, parse_experiment(text.replace("[exemplars]", extra)))
    assert [(change.path, change.effect, change.before) for change in more] == [
        ("factors.lower_lid.levels.more", "measured", None)
    ]
    assert str(more[0]) == "factors.lower_lid.levels.more is new: More"
    gone = difference(parse_experiment(text.replace("[exemplars]", extra)), old)
    assert str(gone[0]) == "factors.lower_lid.levels.more is gone: More"


def test_a_form_that_is_new_is_named_by_its_title_and_not_by_its_code() -> None:
    text = locate("exp3").read_text(encoding="utf-8")
    form = '\n[[forms]]\nname = "tired"\ntitle = { en = "How you feel", de = "Wie es dir geht" }\n'
    form += '[[forms.fields]]\ntype = "text"\nname = "how"\nlabel = { en = "How?", de = "Wie?" }\n'
    new = difference(load_experiment("exp3"), parse_experiment(text + form))
    assert [str(change) for change in new] == ["forms.tired is new: How you feel / Wie es dir geht"]


def test_a_text_in_a_language_that_nobody_has_read_may_join() -> None:
    question = 'question = { en = "How natural was this blink?", de = "Wie natürlich war dieser Lidschlag?" }'
    text = locate("exp3").read_text(encoding="utf-8")
    assert question in text
    more = parse_experiment(text.replace(question, question.replace(" }", ', fr = "Naturel ?" }')))
    changes = difference(load_experiment("exp3"), more)
    assert [(change.path, change.effect) for change in changes] == [("trial.scale.question.fr", "wording")]


def test_a_rule_instead_of_another_is_one_change() -> None:
    changes = edited(('rule = "incomplete"', 'rule = "failed_plays"'))
    assert [(change.path, change.effect) for change in changes] == [("exclusions.1.rule", "wording")]


AFTER = """
[[forms]]
name = "comments"
when = "after"
title = { en = "Comments", de = "Anmerkungen" }
[[forms.fields]]
type = "text"
name = "remark"
label = { en = "Anything else?", de = "Noch etwas?" }
"""
SECOND_FIELD = """[[forms.fields]]
type = "number"
name = "noticed"
label = { en = "How many?", de = "Wie viele?" }
"""


def measured(old: str, new: str) -> bool:
    return changes_what_is_measured(difference(parse_experiment(old), parse_experiment(new)))


def test_what_is_asked_after_every_rating_can_be_added_without_a_new_series() -> None:
    text = locate("exp3").read_text(encoding="utf-8")
    assert not measured(text, text + AFTER)
    assert not measured(text + AFTER, text + AFTER + SECOND_FIELD)
    # Asked before the trials it may change how they are rated.
    assert measured(text, text + AFTER.replace('"after"', '"before"'))
    assert measured(
        text + AFTER.replace('"after"', '"before"'),
        text + AFTER.replace('"after"', '"before"') + SECOND_FIELD,
    )


def test_answers_to_another_question_are_not_pooled_wherever_it_is_asked() -> None:
    text = locate("exp3").read_text(encoding="utf-8")
    two = AFTER + SECOND_FIELD
    assert measured(text + two, text + two.replace('type = "number"', 'type = "text"'))
    assert measured(text + two, text + AFTER)
    assert measured(text + AFTER, text)
    swapped = AFTER.replace(AFTER[AFTER.index("[[forms.fields]]") :], "") + SECOND_FIELD
    swapped += AFTER[AFTER.index("[[forms.fields]]") :]
    assert measured(text + two, text + swapped)
