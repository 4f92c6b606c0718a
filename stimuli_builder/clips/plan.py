"""`stimuli plan`: what an experiment's declaration expands to, before anything is rendered; as a table."""

from collections import Counter
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from experiments import design
from experiments.declaration.experiment import Experiment
from experiments.errors import counted
from experiments.kinds import KINDS, block_sizes, expected_minutes, trials_per_participant
from stimuli_builder.clips.exemplars import recorded_order


def summary(experiment: Experiment) -> dict[str, Any]:
    """The design as plain values.

    Returns
    -------
    dict of str to Any
        By key:

        - `name`, `title`, `participants` as declared;
        - `factors`, a list of {name, label, levels: list of {name, label}};
        - `cells`, a list of cell labels, last factor fastest;
        - `exemplars_per_cell`, `unique_clips`, `trials_per_participant`, `practice_trials`, counts;
        - `blocks`, a list of {label, trials} in declared order, and `order`, how the blocks' order is drawn;
        - `expected_minutes`, the length of a visit in minutes;
        - `notes`, what the kind of trial adds, such as counts of pairs;
        - `repeated_profiles`, a list of {exemplar, profile, group}: recordings that stand for a second one.
    """
    kind = KINDS[experiment.trial.kind]
    doubt = kind.doubt(experiment)
    return {
        "name": experiment.name,
        "title": experiment.title,
        "participants": experiment.participants,
        "factors": [
            {
                "name": factor.name,
                "label": factor.label,
                "levels": [{"name": level.name, "label": level.label} for level in factor.levels],
            }
            for factor in experiment.factors
        ],
        "cells": ["/".join(level for _, level in cell) for cell in design.cells(experiment)],
        "exemplars_per_cell": experiment.exemplars.per_cell,
        "unique_clips": len(design.clips(experiment)),
        "trials_per_participant": trials_per_participant(experiment),
        "practice_trials": experiment.practice.trials,
        "blocks": [block._asdict() for block in block_sizes(experiment)],
        "order": experiment.blocks.order,
        "expected_minutes": expected_minutes(experiment),
        "notes": [*kind.plan(experiment), *([f"check {doubt}"] if doubt else [])],
        "repeated_profiles": repeated_profiles(experiment),
    }


def repeated_profiles(experiment: Experiment, seed: int | None = None) -> list[dict[str, Any]]:
    """Exemplars whose recorded profile already stands for an earlier exemplar of the same cells."""
    clips: dict[str, list[dict[str, Any]]] = {}
    for spec in design.clips(experiment):
        settings = design.render_settings(experiment, spec)
        group = design.exemplar_key(experiment, spec).rpartition("/")[0]
        if settings.performance is None and settings.profile == "real" and group not in clips:
            order = recorded_order(
                experiment.exemplars.per_cell,
                experiment.exemplars.seed if seed is None else seed,
                group,
                paired=settings.eyes == "separate",
            )
            clips[group] = [
                {"exemplar": number, "profile": profile.profile_id, "group": group}
                for number, (profile, repeated) in enumerate(order, start=1)
                if repeated
            ]
    return [entry for entries in clips.values() for entry in entries]


def experiment_folder(name_or_path: str) -> Path | None:
    """Folder that the files named in a TOML are relative to; None for a shipped experiment."""
    path = Path(name_or_path)
    return path.resolve().parent if path.is_file() else None


def print_plan(plan: dict[str, Any]) -> None:
    """Print what `summary` found."""
    console = Console(highlight=False, markup=False)
    console.print(
        Text(plan["name"], "bold"),
        f" {plan['title']}  ({counted(plan['participants'], 'participant')})",
    )
    factors = Table("factor", "levels", box=SIMPLE_HEAD)
    for factor in plan["factors"]:
        factors.add_row(factor["name"], ", ".join(level["name"] for level in factor["levels"]))
    console.print(factors)
    cells, each = len(plan["cells"]), plan["exemplars_per_cell"]
    clips = counted(plan["unique_clips"], "unique clip")
    console.print(f"{counted(cells, 'cell')} x {counted(each, 'exemplar')} = {clips}")
    trials = counted(plan["trials_per_participant"], "trial")
    console.print(f"{trials} per participant in {_blocks(plan['blocks'])}, order {plan['order']}")
    minutes = counted(round(plan["expected_minutes"]), "minute")
    console.print(f"{counted(plan['practice_trials'], 'practice trial')}; about {minutes}")
    for note in plan["notes"]:
        console.print(note)
    for entry in plan["repeated_profiles"]:
        console.print(
            f"exemplar {entry['exemplar']} of '{entry['group'] or 'all cells'}' shows the recorded profile "
            f"{entry['profile']} for the second time"
        )


def _blocks(blocks: list[dict[str, Any]]) -> str:
    counts = Counter((block["label"], block["trials"]) for block in blocks)
    parts = [f"{times} x {label} ({counted(trials, 'trial')})" for (label, trials), times in counts.items()]
    return f"{counted(len(blocks), 'block')}: " + ", ".join(parts)
