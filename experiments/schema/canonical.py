"""One form for equal declarations, and its hash: however written, and whatever keys are added later."""

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from experiments.declaration.base import IMPLIED
from experiments.declaration.experiment import Experiment
from experiments.schema.effects import is_tag
from experiments.schema.stored import earlier_names

# The keys of the first format, as commit c84c2e8 hashed them: all of them, defaults included.
#
# They stay in the hashed form whatever they are set to, so that a declaration from before keeps the hash
# which is stored with its clips and its answers. A key added later is hashed only where it is set to
# something else than its default. This list never changes.

FIRST_KEYS: frozenset[str] = frozenset(
    [
        "analysis",
        "analysis.factors",
        "analysis.kind",
        "analysis.pairs",
        "analysis.statistic",
        "analysis.table",
        "attention",
        "attention.per_block",
        "attention.text",
        "blocks",
        "blocks.break_seconds_min",
        "blocks.order",
        "blocks.repeats",
        "blocks.split_by",
        "blocks.trial_order",
        "display",
        "display.allow_touch",
        "display.background",
        "display.calibrate",
        "display.full_screen",
        "display.inter_ocular_mm",
        "display.minimum_height_px",
        "display.minimum_width_px",
        "display.viewing_distance",
        "exclusions",
        "exclusions.above_ms",
        "exclusions.below_ms",
        "exclusions.more_than",
        "exclusions.rule",
        "exemplars",
        "exemplars.own_per",
        "exemplars.per_cell",
        "exemplars.seed",
        "factors",
        "factors.label",
        "factors.levels",
        "factors.levels.label",
        "factors.levels.name",
        "factors.levels.render",
        "factors.levels.render.amplitude",
        "factors.levels.render.character",
        "factors.levels.render.duration_frames",
        "factors.levels.render.eyes",
        "factors.levels.render.fps",
        "factors.levels.render.lower_lid",
        "factors.levels.render.motion_blur",
        "factors.levels.render.profile",
        "factors.name",
        "forms",
        "forms.fields",
        "forms.fields.help",
        "forms.fields.high",
        "forms.fields.label",
        "forms.fields.low",
        "forms.fields.max_length",
        "forms.fields.maximum",
        "forms.fields.minimum",
        "forms.fields.name",
        "forms.fields.options",
        "forms.fields.options.label",
        "forms.fields.options.value",
        "forms.fields.points",
        "forms.fields.required",
        "forms.fields.type",
        "forms.name",
        "forms.title",
        "forms.when",
        "languages",
        "name",
        "participants",
        "playback",
        "playback.fail_on_focus_lost",
        "playback.failed_longest_gap_ms",
        "playback.failed_missing_frames",
        "playback.flag_video_fallback",
        "playback.flagged_late_frames",
        "playback.flagged_longest_gap_ms",
        "playback.flagged_missing_frames",
        "playback.max_repeats",
        "practice",
        "practice.trials",
        "render",
        "render.amplitude",
        "render.character",
        "render.duration_frames",
        "render.eyes",
        "render.fps",
        "render.height_px",
        "render.lower_lid",
        "render.motion_blur",
        "render.profile",
        "render.width_px",
        "screening.above",
        "screening.below",
        "screening.field",
        "screening.form",
        "screening.more_than",
        "screening.refused",
        "screening.rule",
        "session",
        "session.lease_minutes",
        "session.maximum_age_hours",
        "session.resume",
        "source",
        "texts",
        "texts.block_break",
        "texts.consent",
        "texts.debrief",
        "texts.instructions",
        "texts.practice",
        "title",
        "trial",
        "trial.comment",
        "trial.confirm",
        "trial.expected_seconds",
        "trial.fixation_ms",
        "trial.kind",
        "trial.scale",
        "trial.scale.high",
        "trial.scale.low",
        "trial.scale.maximum",
        "trial.scale.minimum",
        "trial.scale.question",
        "trial.start",
        "trial.views",
        "version",
    ]
)


# Decision 0320: The hash of a declaration contains new keys only where they are set.
def definition_sha256(experiment: Experiment) -> str:
    """SHA-256 over the canonical JSON of a declaration: equal for equal declarations, however written."""
    form = canonical(experiment, FIRST_KEYS, earlier_names())
    return hashlib.sha256(as_json(form).encode("utf-8")).hexdigest()


def as_json(form: object) -> str:
    """JSON with sorted keys: the bytes that are hashed."""
    return json.dumps(form, sort_keys=True, ensure_ascii=False)


def canonical(
    declaration: BaseModel, always: frozenset[str], earlier: Mapping[str, str], prefix: str = ""
) -> dict[str, Any]:
    """The declaration as JSON data, without keys that have their default value.

    Parameters
    ----------
    always : frozenset of str
        Paths of keys that are kept whatever they are set to.
    earlier : mapping of str to str
        Path of each renamed key to its name in the form.
    """
    form: dict[str, Any] = {}
    for name, field in type(declaration).model_fields.items():
        parent, value = prefix, getattr(declaration, name)
        hashed_as = earlier.get(f"{parent}{name}", name)
        path = f"{parent}{hashed_as}"
        if path in always or _tells_apart(field) or value != field.get_default(call_default_factory=True):
            form[hashed_as] = _plain(value, always, earlier, f"{path}.")
    return form


def _tells_apart(field: FieldInfo) -> bool:
    return is_tag(field) and IMPLIED not in field.metadata


def _plain(value: Any, always: frozenset[str], earlier: Mapping[str, str], prefix: str) -> Any:
    if isinstance(value, BaseModel):
        return canonical(value, always, earlier, prefix)
    if isinstance(value, Mapping):
        return {key: _plain(item, always, earlier, prefix) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(item, always, earlier, prefix) for item in value]
    return value
