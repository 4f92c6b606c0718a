"""Who and what was left out of an analysis, in words."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from analysis.plans.exclusions import Exclusions


def left_out(exclusions: "Exclusions") -> tuple[str, ...]:
    """Who and what was left out and why, a line each; a line that says so where nothing was."""
    lines = [
        f"participant {run.participant}{f' (run {run.run})' if run.run != run.participant else ''} excluded: "
        f"{'; '.join(run.reasons)}"
        for run in exclusions.runs
    ]
    lines += [
        f"{d.trials} trials of {d.participants} participants dropped: {d.rule}" for d in exclusions.trials
    ]
    lines += [f"set aside: {aside}" for aside in exclusions.set_aside]
    lines += [f"rule not applied: {reason}" for reason in exclusions.not_applied]
    if not exclusions.runs and not exclusions.trials:
        lines.insert(0, f"no participant and no trial excluded (of {exclusions.n_runs} participants)")
    return tuple(lines)
