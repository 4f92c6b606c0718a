"""Definitions as text and data: their problems, what they expand to, what an edit would do."""

from sqlalchemy.orm import Session

from experiments import design
from experiments.assignment.groups import names
from experiments.declaration.experiment import Experiment
from experiments.errors import InputError
from experiments.kinds import KINDS, block_sizes, expected_minutes, trials_per_participant
from experiments.load import DefinitionError, toml_data
from experiments.wording import unlisted
from server.accounts.identity import Identity
from server.studies.creation import planned_experiment
from server.studies.lookup import find_study
from server.studies.schemas import (
    BlockOut,
    DefinitionCheck,
    DesignOut,
    EditDefinition,
    EditedDefinition,
    FactorOut,
    JudgedEdit,
    LevelOut,
    ProblemOut,
)
from server.studies.series import effects_of_edit
from server.studies.toml_edit import with_data


def design_out(experiment: Experiment) -> DesignOut:
    """What a definition expands to."""
    return DesignOut(
        experiment=experiment.name,
        title=experiment.title,
        factors=[
            FactorOut(
                name=f.name, label=f.label, levels=[LevelOut(name=lv.name, label=lv.label) for lv in f.levels]
            )
            for f in experiment.factors
        ],
        cells=len(design.cells(experiment)),
        exemplars=experiment.exemplars.per_cell,
        unique_clips=len(design.clips(experiment)),
        trials_per_participant=trials_per_participant(experiment),
        blocks=[BlockOut(label=label, trials=count) for label, count in block_sizes(experiment)],
        expected_minutes=expected_minutes(experiment),
        notes=_notes(experiment),
        groups=names(experiment) if experiment.groups.by == "link" else [],
        turned_away=experiment.display.turned_away,
    )


def _notes(experiment: Experiment) -> list[str]:
    """What the kind's plan adds, or why the design cannot be analysed; texts that nobody is offered."""
    unread = [note for note in [unlisted(experiment, experiment.languages)] if note]
    try:
        return [*KINDS[experiment.trial.kind].plan(experiment), *unread]
    except InputError as error:
        return [str(error), *unread]


def check(text: str) -> DefinitionCheck:
    """Every problem of a definition with its line, or what it expands to."""
    try:
        experiment = planned_experiment(text)
    except DefinitionError as error:
        problems = [ProblemOut(line=p.line, path=p.path, message=p.message) for p in error.problems]
        return DefinitionCheck(problems=problems, design=None)
    return DefinitionCheck(problems=[], design=design_out(experiment))


def edit(edited: EditDefinition) -> EditedDefinition:
    """A definition's text with other data in it: what did not change keeps its form and its comments."""
    text = edited.toml if edited.data is None else with_data(edited.toml, edited.data)
    try:
        data = toml_data(text)
    except DefinitionError:
        data = None
    checked = check(text)
    return EditedDefinition(toml=text, data=data, problems=checked.problems, design=checked.design)


def judge_edit(session: Session, name: str, text: str, identity: Identity) -> JudgedEdit:
    """What saving this definition would do to stored answers; DefinitionError where it cannot be used."""
    return effects_of_edit(session, find_study(session, name, identity, "view"), planned_experiment(text))
