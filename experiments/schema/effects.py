"""The effect of an edit of each key on existing answers, and the keys of a declaration as paths."""

from collections.abc import Iterator, Mapping
from typing import Any, Literal, NamedTuple, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from experiments.declaration.experiment import Experiment
from experiments.declaration.trial import ByKind

# The effect of an edit of each key on existing answers.
# `measured`: answers before and after measure different things, so a new data series begins. `wording`: they
# may be pooled. Keys are listed by path; one entry also covers the keys below it that have no entry. Keys
# under `trial` are declared by the kind of trial. A key that no entry covers fails a test.

Effect = Literal["wording", "measured"]

EFFECTS: Mapping[str, Effect] = {
    "name": "measured",
    "title": "wording",
    "participant_title": "wording",
    "version": "wording",
    "source": "wording",
    "participants": "wording",
    "languages": "wording",
    # Names of levels make the cells; labels appear only in tables and figures.
    "factors.name": "measured",
    "factors.label": "wording",
    "factors.between": "measured",
    # Which test is made of the same answers.
    "factors.random": "wording",
    "factors.per_participant": "measured",
    "factors.character": "measured",
    "factors.levels.name": "measured",
    "factors.levels.label": "wording",
    "factors.levels.render": "measured",
    "render": "measured",
    "exemplars": "measured",
    "assignment": "measured",
    "groups.by": "measured",
    "groups.answers": "measured",
    # How many take part, as `participants`.
    "groups.quotas": "wording",
    "blocks.split_by": "measured",
    "blocks.repeats": "measured",
    "blocks.order": "measured",
    "blocks.trial_order": "measured",
    "blocks.break_seconds_min": "wording",
    "practice.trials": "measured",
    # How large, on what ground and how steadily a clip is seen; but not which devices are turned away.
    "display.inter_ocular_mm": "measured",
    "display.calibrate": "measured",
    "display.calibration_repeats": "wording",
    "display.recheck_size": "wording",
    "display.viewing_distance": "wording",
    "display.right_to_left_scales": "measured",
    "display.full_screen": "measured",
    "display.background": "measured",
    "display.minimum_width_px": "wording",
    "display.minimum_height_px": "wording",
    "display.allow_touch": "wording",
    "display.sync_patch": "measured",
    "session": "wording",
    # A play that counts by the one rule does not by the other.
    "playback": "measured",
    "attention": "wording",
    "evidence": "wording",
    # Who takes part and whose answers count: both are applied to the whole series, and reported with it.
    "screening": "wording",
    "warnings": "wording",
    "exclusions": "wording",
    # Those after the trials may be added: nothing that is asked after every rating changes a rating
    # (`experiments.schema.difference`).
    "forms.name": "measured",
    "forms.when": "wording",
    "forms.title": "wording",
    "forms.fields": "measured",
    "forms.fields.label": "wording",
    "forms.fields.help": "wording",
    "forms.fields.required": "wording",
    "forms.fields.max_length": "wording",
    "forms.fields.options.label": "wording",
    "texts": "wording",
    "analysis": "wording",
    # Carried out by the server; no answer is to another question.
    "retention": "wording",
    "dataset": "wording",
}


def effects_with(below_trial: Mapping[str, Effect]) -> dict[str, Effect]:
    """The table with the keys of one kind of trial, which are under `trial`."""
    return {**EFFECTS, "trial.kind": "measured", **{f"trial.{key}": of for key, of in below_trial.items()}}


# Decision 0321: Which edits begin a new data series.
def effect_of(path: str, effects: Mapping[str, Effect] = EFFECTS) -> Effect | None:
    """The effect of the key at `path`: its own entry, or that of the nearest table above; None if there is
    none."""
    while path:
        if path in effects:
            return effects[path]
        path = path.rpartition(".")[0]
    return None


# The keys of a declaration as dotted paths, by walking the models: `factors.levels.render.fps`.
#
# List indices are left out of a path, and a mapping from languages to texts is one key. Models of a union
# share their paths.


class Key(NamedTuple):
    """One key: its path, the model that declares it, and how."""

    path: str
    model: type[BaseModel]
    field: FieldInfo

    @property
    def name(self) -> str:
        """The last part of the path."""
        return self.path.rpartition(".")[2]

    @property
    def tables(self) -> list[type[BaseModel]]:
        """The models that the key may hold and that have keys themselves."""
        for mark in self.field.metadata:
            if isinstance(mark, ByKind):
                return list(mark.models().values())
        return models_inside(self.field.annotation)


def keys(model: type[BaseModel] = Experiment, prefix: str = "") -> Iterator[Key]:
    """Every key of `model` and of its nested models, depth first; a table comes before its keys."""
    for name, field in model.model_fields.items():
        path = f"{prefix}{name}"
        key = Key(path, model, field)
        yield key
        for inner in key.tables:
            yield from keys(inner, f"{path}.")


def paths(model: type[BaseModel] = Experiment, prefix: str = "") -> set[str]:
    """Paths of the keys that hold values rather than further keys."""
    return {key.path for key in keys(model, prefix) if not key.tables}


def models_inside(annotation: Any) -> list[type[BaseModel]]:
    """The models a key may hold: itself, or the members of a union, tuple or mapping."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    if get_origin(annotation) is Literal:
        return []
    return [model for argument in get_args(annotation) for model in models_inside(argument)]


def is_tag(field: FieldInfo) -> bool:
    """True for the key that identifies a member of a union: its only value is a constant."""
    return get_origin(field.annotation) is Literal and len(get_args(field.annotation)) == 1
