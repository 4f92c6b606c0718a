"""A plan as a person reads it."""

from collections import Counter
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table


def print_plan(plan: dict[str, Any]) -> None:
    """Print what `summary` found."""
    console = Console(highlight=False)
    console.print(f"[bold]{plan['name']}[/bold]  {plan['title']}  ({plan['participants']} participants)")
    factors = Table("factor", "levels", box=SIMPLE_HEAD)
    for factor in plan["factors"]:
        factors.add_row(factor["name"], ", ".join(level["name"] for level in factor["levels"]))
    console.print(factors)
    cells, each = len(plan["cells"]), plan["exemplars_per_cell"]
    console.print(f"{cells} cells x {each} exemplars = {plan['unique_clips']} unique clips")
    console.print(
        f"{plan['trials_per_participant']} trials per participant in {_blocks(plan['blocks'])}, "
        f"order {plan['order']}"
    )
    console.print(f"{plan['practice_trials']} practice trials; about {plan['expected_minutes']:.0f} minutes")
    for note in plan["notes"]:
        console.print(note)
    for entry in plan["repeated_profiles"]:
        console.print(
            f"exemplar {entry['exemplar']} of '{entry['group'] or 'all cells'}' shows the recorded profile "
            f"{entry['profile']} for the second time"
        )


def _blocks(blocks: list[dict[str, Any]]) -> str:
    counts = Counter((block["label"], block["trials"]) for block in blocks)
    parts = [f"{times} x {label} ({trials} trials)" for (label, trials), times in counts.items()]
    return f"{len(blocks)} blocks: " + ", ".join(parts)
