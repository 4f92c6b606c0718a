"""What a study is: the tables of its TOML, its forms, rules and kinds of trial, as frozen data."""

from experiments.declaration.experiment import Experiment
from experiments.declaration.factors import Exemplars, Factor, Level
from experiments.declaration.tables import (
    AnalysisPlan,
    Assignment,
    Blocks,
    Display,
    Evidence,
    Practice,
    Session,
    Texts,
)

__all__ = [
    "AnalysisPlan",
    "Assignment",
    "Blocks",
    "Display",
    "Evidence",
    "Exemplars",
    "Experiment",
    "Factor",
    "Level",
    "Practice",
    "Session",
    "Texts",
]
