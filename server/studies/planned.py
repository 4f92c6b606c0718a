"""A definition that may be stored: one that can be read, and whose design can be analysed."""

from experiments.definition import Experiment
from experiments.errors import InputError
from experiments.load import DefinitionError, Problem, parse_experiment
from experiments.toml_lines import line_of
from experiments.trials import KINDS


def planned_experiment(text: str, source: str = "definition") -> Experiment:
    """Parse a definition and plan its trials.

    Raises
    ------
    DefinitionError
        With every problem and its line; or with the one that the plan names, such as clips that
        are never compared with the others.
    """
    experiment = parse_experiment(text, source)
    try:
        KINDS[experiment.trial.kind].plan(experiment)
    except InputError as error:
        message = str(error).removeprefix(f"'{experiment.name}': ")
        raise DefinitionError(source, [Problem(line_of(text, ("trial",)), "trial", message)]) from error
    return experiment
