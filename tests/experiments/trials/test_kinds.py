"""What every kind of trial must do; a toy kind, which lives in this folder only, does it too."""

import json
import re
import tomllib
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import pytest
from pydantic import TypeAdapter, ValidationError

from experiments import design
from experiments.columns import names_of
from experiments.declaration.any_trial import TRIALS
from experiments.declaration.experiment import Experiment
from experiments.kinds import KINDS, block_sizes, reserved_names, trials_per_participant, views
from experiments.kinds.kind import Kind
from experiments.load import DefinitionError, load_stored, locate, parse_experiment
from experiments.schema.canonical import definition_sha256
from experiments.schema.difference import difference
from experiments.schema.effects import effect_of, effects_with, paths
from experiments.schema.stored import FORMAT
from tests.conftest import REPOSITORY
from tests.experiments.trials.toy import TOY

RATING = KINDS["clip_rating"]
DEGRADED = next(one for one in RATING.further_examples if 'level = "none"' in one)
OF_EXP3 = DEGRADED.replace('"compression"', '"lower_lid"').replace('level = "none"', 'level = "both"')
ALL = {kind.name: kind for kind in (*KINDS.values(), TOY)} | {
    "degradation": replace(RATING, example=OF_EXP3, roles=("shown", "reference"))
}
"""By name; ratings after a reference are the kind of single clips, with their example and clips."""


@pytest.fixture(params=ALL)
def kind(request: pytest.FixtureRequest) -> Iterator[Kind]:
    """The kind, registered by the two lines that a new kind needs."""
    made = ALL[request.param]
    before = KINDS.get(made.name)
    KINDS[made.name], TRIALS[made.name] = made, made.declaration
    Experiment.model_rebuild(force=True)
    yield made
    if before is None:
        del KINDS[made.name], TRIALS[made.name]
        Experiment.model_rebuild(force=True)
    else:
        KINDS[made.name] = before


def text_with(trial: str) -> str:
    text = locate("exp3").read_text(encoding="utf-8")
    assert text.count("[trial]") == 1
    return re.sub(r"(?s)\[trial\].*?(?=\[display\])", lambda _: trial + "\n", text)


def declared(kind: Kind) -> Experiment:
    return parse_experiment(text_with(kind.example))


def test_its_example_is_a_declaration_of_its_own_type(kind: Kind) -> None:
    experiment = declared(kind)
    assert type(experiment.trial) is kind.declaration
    assert experiment.trial.kind == kind.name


def test_its_plan_is_lines(kind: Kind) -> None:
    assert all(isinstance(line, str) for line in kind.plan(declared(kind)))


def test_an_unknown_key_is_named_with_its_line_and_the_nearest_right_one(kind: Kind) -> None:
    text = text_with(kind.example.replace("[trial]", "[trial]\nexpected_secnds = 3.0"))
    line = text.splitlines().index("expected_secnds = 3.0") + 1
    with pytest.raises(DefinitionError, match="did you mean 'expected_seconds'") as raised:
        parse_experiment(text)
    assert raised.value.problems[0].line == line
    assert raised.value.problems[0].path == "trial.expected_secnds"


def test_an_unknown_kind_is_named_with_its_line_and_the_nearest_right_one(kind: Kind) -> None:
    wrong = kind.name[:-1]
    text = text_with(kind.example.replace(kind.name, wrong))
    with pytest.raises(DefinitionError) as raised:
        parse_experiment(text)
    problem = raised.value.problems[0]
    assert problem.message == f"no such kind '{wrong}'; did you mean '{kind.name}'?"
    assert problem.line == text.splitlines().index(f'kind = "{wrong}"') + 1


def test_every_key_says_what_an_edit_of_it_does(kind: Kind) -> None:
    effects = effects_with(kind.effects)
    own = paths(kind.declaration, "trial.")
    assert {path for path in own if effect_of(path, effects) is None} == set()
    assert {key.partition(".")[0] for key in kind.effects} <= set(kind.declaration.model_fields)


def test_it_is_stored_and_read_again_with_its_hash(kind: Kind) -> None:
    experiment = declared(kind)
    again = load_stored(json.loads(experiment.model_dump_json()), FORMAT)
    assert again == experiment
    assert definition_sha256(again) == definition_sha256(experiment)


def test_an_edit_of_it_is_named(kind: Kind) -> None:
    old = declared(kind)
    slower = old.trial.model_copy(update={"expected_seconds": 99.0})
    changes = difference(old, old.model_copy(update={"trial": slower}))
    assert [(change.path, change.effect) for change in changes] == [("trial.expected_seconds", "wording")]


def test_an_experiment_of_another_kind_is_measured(kind: Kind) -> None:
    others = [other for other in KINDS.values() if other.name != kind.name]
    for other in others:
        changes = difference(declared(kind), declared(other))
        assert [(change.path, change.effect) for change in changes] == [("trial.kind", "measured")]
        assert definition_sha256(declared(kind)) != definition_sha256(declared(other))


@pytest.mark.parametrize("slot", [0, 1, 7])
def test_its_trials_show_clips_of_the_design_in_its_roles(kind: Kind, slot: int) -> None:
    experiment = declared(kind)
    clips, trials = set(design.clips(experiment)), kind.assign(experiment, 5, slot)
    assert kind.assign(experiment, 5, slot) == trials
    assert kind.assign(experiment, 6, slot) != trials
    for trial in trials:
        if trial.kind != "attention":
            assert {shown.role for shown in trial.shown} == set(kind.roles)
            assert {shown.clip for shown in trial.shown} <= clips


def test_its_trials_are_as_many_as_its_blocks_say(kind: Kind) -> None:
    experiment = declared(kind)
    main = [trial for trial in kind.assign(experiment, 5, 0) if trial.kind == "main"]
    sizes = Counter[str]()
    for block in block_sizes(experiment):
        sizes[block.label] += block.trials
    assert Counter(trial.block_label for trial in main) == sizes
    assert trials_per_participant(experiment) == len(main)


def test_the_page_gets_a_part_of_it(kind: Kind) -> None:
    told = kind.shown(declared(kind))
    assert isinstance(told, kind.page)
    assert told.model_dump()["kind"] == kind.name


def test_its_columns_are_a_view_with_the_base_columns(kind: Kind) -> None:
    names = names_of(kind.view.columns)
    assert len(set(names)) == len(names)
    assert {"study", "run", "participant", "definition_sha256"} <= set(names)
    assert all(column.description.endswith(".") for column in kind.view.columns)
    assert kind.view in views()
    assert set(names) <= reserved_names()
    for dialect in ("sqlite", "postgresql"):
        assert kind.view.create(dialect).startswith(f"CREATE VIEW {kind.view.name} AS")


def test_its_answer_is_typed_to_the_end(kind: Kind) -> None:
    assert kind.answer.model_json_schema()["additionalProperties"] is False
    with pytest.raises(ValidationError):
        kind.answer.model_validate({"no such": "answer"})


def test_it_is_in_the_schema_of_the_api(kind: Kind) -> None:
    schema = TypeAdapter(Experiment).json_schema()
    assert kind.declaration.__name__ in schema["$defs"]
    assert kind.name in schema["properties"]["trial"]["discriminator"]["mapping"]


def test_the_toy_is_gone_afterwards() -> None:
    assert TOY.name not in KINDS
    with pytest.raises(DefinitionError, match="no such kind 'same_or_not'"):
        parse_experiment(text_with(TOY.example))


@pytest.mark.parametrize(
    ("demo", "lengths", "lasted"),
    [
        ("exp1", {"shown": 1500.0}, 1500.0),
        ("dcr-demo", {"shown": 1000.0, "reference": 1200.0}, 4200.0),
        ("dcr-demo", {}, 0.0),
        ("pairs-demo", {"left": 1000.0, "right": 1300.0}, 1300.0),
        ("threshold-demo", {"shown": 1000.0}, 1000.0),
    ],
)
def test_a_showing_lasts_as_long_as_what_is_shown_in_turn(
    demo: str, lengths: dict[str, float], lasted: float
) -> None:
    declared = parse_experiment(
        (REPOSITORY / "experiments" / f"{demo}.toml").read_text(encoding="utf-8")
    ).trial
    assert declared.shown_ms(lengths) == lasted


def test_a_pair_in_turn_lasts_as_long_as_both() -> None:
    at_once = (REPOSITORY / "experiments" / "pairs-demo.toml").read_text(encoding="utf-8")
    shown = '{ arrangement = "side_by_side", gap_mm = 8.0, if_too_narrow = "stack" }'
    assert shown in at_once
    declared = parse_experiment(
        at_once.replace(shown, '{ arrangement = "one_after_the_other", gap_ms = 300 }')
    )
    assert declared.trial.shown_ms({"first": 1000.0, "second": 1300.0}) == 2600.0


def test_two_intervals_last_as_long_as_both() -> None:
    threshold = KINDS["threshold"]
    declared = threshold.declaration.model_validate(tomllib.loads(threshold.further_examples[0])["trial"])
    assert declared.shown_ms({"first": 1000.0, "second": 1000.0}) == 2500.0
