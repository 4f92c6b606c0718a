"""What an edit changes: key by key, and whether answers before and after may be pooled."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from experiments.declaration.experiment import Experiment
from experiments.kinds import KINDS
from experiments.schema.effects import EFFECTS, Effect, effect_of, effects_with

TAGS = ("kind", "type", "rule")


@dataclass(frozen=True)
class Change:
    """One key that differs.

    Attributes
    ----------
    path : str
        As the TOML has it, elements of lists by their name or number: `factors.speed.levels.fast.label`.
    effect : {"wording", "measured"}
        `wording` or `measured`.
    before, after : Any
        The values; None where the key or element is not there.
    """

    path: str
    effect: Effect
    before: Any
    after: Any

    def __str__(self) -> str:
        if self.before is None:
            return f"{self.path} is new: {_short(self.after)}"
        if self.after is None:
            return f"{self.path} is gone: {_short(self.before)}"
        return f"{self.path}: {_short(self.before)} becomes {_short(self.after)}"


def difference(old: Experiment, new: Experiment) -> list[Change]:
    """Every key that differs, what is measured first."""
    before, after = old.model_dump(mode="json"), new.model_dump(mode="json")
    changes = list(_Edit(KINDS[new.trial.kind].effects).changes(before, after, "", ""))
    return sorted(changes, key=lambda change: change.effect == "wording")


def changes_what_is_measured(changes: Sequence[Change]) -> bool:
    """True where answers before and after must not be pooled: a new data series begins."""
    return any(change.effect == "measured" for change in changes)


class _Edit:
    """Walks two declarations whose trials are (or become) of a kind with these effects."""

    def __init__(self, below_trial: Mapping[str, Effect]) -> None:
        self._effects = effects_with(below_trial)
        self._after_trials = False

    def _effect(self, path: str) -> Effect:
        # A path that no entry covers is kept apart: the safe side.
        return effect_of(path, self._effects) or "measured"

    def changes(self, old: Any, new: Any, shown: str, path: str) -> Iterator[Change]:
        """What differs at `path`, called `shown`."""
        if old == new:
            return
        if tag := _tag_that_differs(old, new):
            effect = self._effect(_join(path, tag))
            yield Change(_join(shown, tag), effect, old[tag], new[tag])
        elif isinstance(old, dict) and isinstance(new, dict):
            yield from self._of_tables(old, new, shown, path)
        elif _are_elements(old) and _are_elements(new):
            yield from self._of_lists(old, new, shown, path)
        else:
            yield Change(shown, self._effect(path), old, new)

    def _of_tables(self, old: dict[str, Any], new: dict[str, Any], shown: str, path: str) -> Iterator[Change]:
        for key in dict.fromkeys((*old, *new)):
            if key not in old or key not in new:
                # Tables have all their keys, so this is a text, or a set of them, in one language only:
                # nobody has read both.
                yield Change(_join(shown, key), "wording", old.get(key), new.get(key))
                continue
            # Languages are not part of a path.
            below = path if path == "texts" else _join(path, key)
            yield from self.changes(old[key], new[key], _join(shown, key), below)

    def _of_lists(self, old: list[Any], new: list[Any], shown: str, path: str) -> Iterator[Change]:
        before, after = _by_name(old), _by_name(new)
        for name in dict.fromkeys((*before, *after)):
            if name in before and name in after:
                was_after, self._after_trials = (
                    self._after_trials,
                    self._asked_last(path, before[name], after[name]),
                )
                yield from self.changes(before[name], after[name], _join(shown, name), path)
                self._after_trials = was_after
            else:
                added_last = name not in before and self._asked_last(path, after[name])
                effect = "wording" if added_last else self._effect(f"{path}.name")
                yield Change(_join(shown, name), effect, before.get(name), after.get(name))
        kept_before, kept_after = (
            [name for name in one if name in before and name in after] for one in (before, after)
        )
        if kept_before != kept_after:
            yield Change(shown, self._effect(f"{path}.name"), list(before), list(after))

    def _asked_last(self, path: str, *elements: Any) -> bool:
        """True of forms after the trials and their questions: what is new there follows every rating."""
        if path == "forms":
            return all(form.get("when") == "after" for form in elements)
        return path == "forms.fields" and self._after_trials


def _tag_that_differs(old: Any, new: Any) -> str | None:
    """The key by which these are two members of a union: their other keys have nothing in common."""
    if not (isinstance(old, dict) and isinstance(new, dict)):
        return None
    return next((tag for tag in TAGS if tag in old and tag in new and old[tag] != new[tag]), None)


def _are_elements(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(item, Mapping) for item in value)


def _by_name(items: list[Any]) -> dict[str, Any]:
    """Elements of a list by their name, the value of an option, or their number where they have neither."""
    return {
        str(item.get("name", item.get("value", number))): item for number, item in enumerate(items, start=1)
    }


def _join(path: str, key: str) -> str:
    return f"{path}.{key}" if path else key


_TITLES = ("title", "label", "question", "text", "name")
"""Keys whose value identifies a table for a reader, the most informative first."""


def _in_words(value: Any) -> str:
    if isinstance(value, dict):
        known = next((value[key] for key in _TITLES if value.get(key)), None)
        texts = value.values() if known is None else (known,)
        return " / ".join(_in_words(text) for text in texts)
    return ", ".join(map(_in_words, value)) if isinstance(value, list) else str(value)


def _short(value: Any) -> str:
    text = _in_words(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


# What a page needs to edit a declaration: every key with its type, limits and help.


def editor_schema() -> dict[str, Any]:
    """The declaration's JSON schema, and the effects of edits by path, those of each kind of trial apart."""
    return {
        "schema": Experiment.model_json_schema(),
        "effects": dict(EFFECTS),
        "trial_effects": {name: dict(kind.effects) for name, kind in KINDS.items()},
    }
