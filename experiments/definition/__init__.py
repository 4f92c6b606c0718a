"""What a study is: one module a table of the TOML, `forms` with a module a type of field."""

from experiments.definition.analysis_plan import AnalysisPlan
from experiments.definition.assignment import Assignment
from experiments.definition.blocks import Blocks, Practice
from experiments.definition.display import Display
from experiments.definition.evidence import Evidence
from experiments.definition.experiment import Experiment
from experiments.definition.factors import Exemplars, Factor, Level
from experiments.definition.session import Session
from experiments.definition.texts import Texts

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
