"""Read a declaration that a database holds, in whatever format it was stored."""

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from experiments.consistency import check_consistency
from experiments.definition.experiment import Experiment
from experiments.errors import InputError
from experiments.schema.upgrades import upgraded
from experiments.wrong_values import wrong_value


def load_stored(definition: Mapping[str, Any], number: int = 1) -> Experiment:
    """The declaration stored as JSON data of format `number`; InputError where it cannot be read."""
    data = upgraded(definition, number)
    try:
        experiment = Experiment.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        path = ".".join(str(part) for part in first["loc"])
        name = definition.get("name", "without a name")
        raise InputError(
            f"the stored definition {name} (format {number}) cannot be read: {path}: {wrong_value(first)}; "
            "use the version of this program that stored it, and report this"
        ) from error
    try:
        check_consistency(experiment, has_data=True)
    except ValueError as error:
        name = definition.get("name", "without a name")
        raise InputError(
            f"the stored definition {name} (format {number}) cannot be read: {error}; "
            "use the version of this program that stored it, and report this"
        ) from error
    return experiment
