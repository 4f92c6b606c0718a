"""`character = [...]`: the levels of a factor, or of one added last, in a list of names."""

import json
from collections.abc import Callable

import pytest

from experiments import design
from experiments.declaration.experiment import Experiment
from experiments.load import DefinitionError, parse_experiment
from experiments.schema.canonical import definition_sha256
from tests.helpers.faces import DEMO, HEAD, PROFILES, faces

SHOWN = {"alder": "alder@11", "birch": "birch@9", "cedar": "cedar@7", "hazel": "hazel@7"}
LIST = f"character = {json.dumps(list(SHOWN.values()))}"


def as_factor(line: str, keys: str = "random = true\nper_participant = 2") -> Experiment:
    face = f'[[factors]]\nname = "face"\nlabel = "Face"\n{keys}\n{line}\n\n'
    return parse_experiment(f"{HEAD}{face}[[factors]]{PROFILES}")


def in_render(value: str) -> Experiment:
    text = f"{HEAD}[[factors]]{PROFILES}".replace('character = "alder@8"', f"character = {value}")
    return parse_experiment(text.replace('own_per = ["face"]', 'own_per = ["character"]'))


def test_a_list_reads_as_the_levels_it_is_short_for() -> None:
    levels = "".join(
        f'[[factors.levels]]\nname = "{name}"\nlabel = "{name.title()}"\n'
        f'render = {{ character = "{character}" }}\n'
        for name, character in SHOWN.items()
    )
    short, long = as_factor(LIST), as_factor(levels)
    assert short == long
    assert definition_sha256(short) == definition_sha256(long) == definition_sha256(parse_experiment(DEMO))
    assert short.factors[0].random
    assert short.factors[0].per_participant == 2


def test_a_declaration_that_was_read_is_read_again_alike() -> None:
    """The builder and the database hold it as data, in which the list has become levels."""
    experiment = as_factor(LIST)
    data = experiment.model_dump(mode="json")
    assert data["factors"][0]["character"] == []
    assert Experiment.model_validate(data) == experiment


def test_a_list_in_render_is_a_last_factor_that_all_see() -> None:
    experiment = in_render('["alder", "birch"]')
    assert experiment.factor_names == ("profile", "character")
    added = experiment.factor("character")
    assert not added.random
    assert not added.between
    shown = {
        clip.level("character"): design.render_settings(experiment, clip).character
        for clip in design.clips(experiment)
    }
    assert shown == {"alder": "alder", "birch": "birch"}
    assert experiment.render.character == "alder"


def test_folders_give_levels_their_own_name_and_versions_are_dropped() -> None:
    listed = '["faces/old-face", "birch@6", "faces/@mary", "ann@home", "ann@work"]'
    experiment = as_factor(f"character = {listed}", "random = true")
    assert [(level.name, level.label) for level in experiment.factors[0].levels] == [
        ("old-face", "Old face"),
        ("birch", "Birch"),
        ("@mary", "@mary"),
        ("ann@home", "Ann@home"),
        ("ann@work", "Ann@work"),
    ]
    assert experiment.factors[0].levels[0].render.character == "faces/old-face"


@pytest.mark.parametrize(
    ("listed", "message"),
    [
        ('["alder", 3]', 'expected a list such as ["alder@8", "birch@6"], got the list ["alder", 3]'),
        ('["alder", ""]', "expected a list such as"),
        ("[]", "expected a list such as"),
        ('["..", "birch"]', "expected a list such as"),
        ('["alder/..", "birch"]', "expected a list such as"),
        ('[".", "birch"]', "expected a list such as"),
        ('["alder", "alder"]', "'alder' is used twice"),
        ('["a/b", "c/b"]', "'b' is used twice"),
        ('["alder@4", "alder@8"]', "'alder' is used twice"),
    ],
)
@pytest.mark.parametrize("make", [lambda listed: as_factor(f"character = {listed}"), in_render])
def test_a_list_that_makes_no_levels_is_said_in_one_line(
    make: Callable[[str], Experiment], listed: str, message: str
) -> None:
    with pytest.raises(DefinitionError) as raised:
        make(listed)
    assert message in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_factor_wants_a_list_and_render_a_name_or_a_list() -> None:
    with pytest.raises(DefinitionError, match=r"line 10: .*expected a list such as .*, got 'alder'"):
        as_factor('character = "alder"')
    with pytest.raises(
        DefinitionError, match=r"render.character: expected a list such as .*, got an empty list"
    ):
        in_render("[]")


def test_levels_and_a_list_are_refused_together() -> None:
    with pytest.raises(DefinitionError, match="expected `character` or `levels`, got both"):
        faces(3, 2, keys=f"random = true\n{LIST}")


def test_a_factor_that_is_called_character_is_not_added_twice() -> None:
    text = DEMO.replace('name = "face"', 'name = "character"').replace('own_per = ["face"]', "")
    with pytest.raises(DefinitionError, match="'character'"):
        parse_experiment(text.replace('character = "alder@8"', 'character = ["alder", "birch"]'))


def test_a_fault_below_a_list_in_render_keeps_its_line() -> None:
    text = DEMO.replace('character = "alder@8"', 'character = ["alder", "birch"]').replace(
        "duration_frames = 9 }", "duration_frames = 1 }", 1
    )
    with pytest.raises(DefinitionError) as raised:
        parse_experiment(text)
    number = next(k for k, line in enumerate(text.splitlines(), 1) if "duration_frames = 1 }" in line)
    assert raised.value.problems[0].line in {number, number - 1, number - 2, number - 3}
