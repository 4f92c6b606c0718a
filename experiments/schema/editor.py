"""What a page needs to edit a declaration: every key with its type, limits and help."""

from typing import Any

from experiments.definition import Experiment
from experiments.schema.effects import EFFECTS
from experiments.trials import KINDS


def editor_schema() -> dict[str, Any]:
    """The declaration's JSON schema, and the effects of edits by path, those of each kind of trial apart."""
    return {
        "schema": Experiment.model_json_schema(),
        "effects": dict(EFFECTS),
        "trial_effects": {name: dict(kind.effects) for name, kind in KINDS.items()},
    }
