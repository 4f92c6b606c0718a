"""A rehearsal from the button to its report: simulated people, in a database that is not people's."""

import time
from typing import Any

import pytest

from experiments.declaration.experiment import Experiment
from experiments.errors import InputError
from experiments.kinds import KINDS
from experiments.kinds.kind import PlanCommand
from experiments.load import load_experiment, locate, parse_experiment
from server.context import Services
from server.models import Link, Rating, StudyRun
from tests.helpers.admins import Admin
from tests.helpers.studies import SHORT, Participant

PATH = "/studies/short/rehearsals"
FOUR_PAIRS = """{ among = "declared", cells = [
    { cell = "photorealistic/model", other = "photorealistic/textbook" },
    { cell = "photorealistic/model", other = "cartoon/model" },
    { cell = "photorealistic/model", other = "cartoon/textbook" },
    { cell = "cartoon/model", other = "cartoon/textbook" },
] }"""
ASYMMETRIC = """    { name = "asymmetric", levels = { asymmetry = "asymmetric" } },
"""
LIMIT_S = 300


def plan_command(experiment: Experiment) -> PlanCommand:
    """The plan of power that a study's kind of trial asks for."""
    return KINDS[experiment.trial.kind].power(experiment)


def counts(services: Services) -> list[int]:
    with services.database.read() as session:
        return [session.query(table).count() for table in (StudyRun, Rating, Link)]


def done(admin: Admin) -> Any:
    """The latest rehearsal, once it has ended."""
    limit = time.monotonic() + LIMIT_S
    while (latest := admin.get(f"{PATH}/latest").json())["status"] in ("queued", "running"):
        assert time.monotonic() < limit, latest
        time.sleep(0.2)
    return latest


def test_a_rehearsal_shows_everything_and_leaves_the_data_alone(
    services: Services, experimenter: Admin, participant: Participant
) -> None:
    participant.agree().rate_all()
    before = counts(services)
    assert experimenter.get(f"{PATH}/latest").json() is None
    begun = experimenter.send("POST", PATH, {"participants": 2, "seed": 3})
    assert begun.status_code == 202, begun.text
    assert experimenter.send("POST", PATH, {}).status_code == 409
    latest = done(experimenter)
    assert (latest["status"], latest["message"], latest["version"]) == ("done", "", 1)
    assert counts(services) == before
    shown = experimenter.get(f"{PATH}/{latest['id']}").json()
    assert (shown["participants"], shown["complete"], len(shown["people"])) == (2, 2, 2)
    first, second = shown["people"]
    assert len(first["trials"]) == len(second["trials"]) == 12
    assert shown["answers"] >= 24
    assert first["minutes"] > 0
    kinds = {trial["kind"] for trial in first["trials"]}
    assert kinds == {"practice", "main", "attention"}
    assert all(bool(trial["clips"]) == (trial["kind"] != "attention") for trial in first["trials"])
    columns = {(column["table"], column["name"]): column for column in shown["columns"]}
    assert columns["ratings", "response"]["example"] in {str(point) for point in range(1, 8)}
    assert columns["runs", "form_about_age"]["meaning"]
    assert shown["report_problem"] == ""
    page = experimenter.get(f"{PATH}/{latest['id']}/report/report.html")
    assert (page.status_code, "simulated" in page.text.lower()) == (200, True)
    assert experimenter.get(f"{PATH}/{latest['id']}/report/order.json").status_code == 404
    assert shown["power_problem"] == ""
    assert set(shown["power"]["effects"]) == {"character", "speed"}
    assert not (services.settings.data_folder / "rehearsals" / latest["id"] / "sandbox").exists()


@pytest.mark.parametrize(
    ("name", "command"),
    [
        ("exp3", "plan anova --within lower_lid:4 --effect lower_lid=0.25 --statistic multivariate"),
        ("pairs-demo", "plan pairs --abilities 0.0,0.3,0.6,0.9 --repeats 2"),
    ],
)
def test_the_power_that_a_declaration_asks_for(name: str, command: str) -> None:
    assert " ".join(plan_command(load_experiment(name)).arguments) == command


def test_thresholds_are_planned_with_the_trials_of_a_series() -> None:
    arguments = plan_command(load_experiment("threshold-demo")).arguments
    assert arguments[arguments.index("--levels") + 1].split(",")[0] == "100"
    assert arguments[-4:] == ["--guess", "0.02", "--trials", "3"]


@pytest.mark.parametrize(
    ("name", "change", "problem"),
    [
        ("plane-demo", ("", ""), "there are no conditions to compare"),
        ("pairs-demo", ("expected_seconds = 8.0", "pairs_per_person = 4"), "here it is 4 of 6 pairs"),
        (
            "pairs-demo",
            ('{ among = "all", exemplars = "matched" }', FOUR_PAIRS),
            "all pairs of items are compared",
        ),
        ("pairs-demo", ('label = "Character"', 'label = "Character"\nbetween = true'), "different items"),
        (
            "pairs-demo",
            ("expected_seconds = 8.0", 'pairs_per_person = 6\ndealing = { by = "active" }'),
            "chosen from the answers",
        ),
        ("threshold-demo", (ASYMMETRIC, ""), "there is only one series"),
    ],
)
def test_a_power_that_no_plan_computes_is_not_shown(name: str, change: tuple[str, str], problem: str) -> None:
    text = locate(name).read_text(encoding="utf-8")
    experiment = parse_experiment(text.replace(*change))
    with pytest.raises(InputError, match=problem):
        plan_command(experiment)


def test_factors_between_participants_are_planned_as_such() -> None:
    between = SHORT.replace('name = "character"', 'name = "character"\nbetween = true', 1)
    between = between.replace('split_by = "character"\norder = "alternating"', "")
    planned = plan_command(parse_experiment(between))
    assert planned.arguments[2:6] == ["--within", "speed:2", "--between", "character:2"]
    assert planned.assumed.endswith("two means of a participant correlate by 0.5")
    apart = plan_command(
        parse_experiment(between.replace('name = "speed"', 'name = "speed"\nbetween = true'))
    )
    assert apart.arguments[2:4] == ["--between", "character:2,speed:2"]
    assert apart.assumed.endswith("each participant gives one mean")
