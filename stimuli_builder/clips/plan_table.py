"""A plan as a person reads it."""

from collections import Counter
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from experiments.counted import counted


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
