"""The [trial] of every kind, and the type of a [trial] that is of any of them."""

from typing import Annotated

from experiments.trials.clip_rating.declaration import ClipRating
from experiments.trials.continuous_rating.declaration import ContinuousRating
from experiments.trials.declared import ByKind, TrialDeclaration
from experiments.trials.paired_comparison.declaration import PairedComparison
from experiments.trials.threshold.declaration import Threshold

TRIALS: dict[str, type[TrialDeclaration]] = {
    str(trial.model_fields["kind"].default): trial
    for trial in (ClipRating, PairedComparison, Threshold, ContinuousRating)
}
"""Every kind's declaration by the name that a TOML gives it; the first is meant where none is given."""

AnyTrial = Annotated[TrialDeclaration, ByKind(lambda: TRIALS, implied=True)]
