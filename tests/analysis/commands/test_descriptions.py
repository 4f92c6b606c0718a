"""The command `analysis` does without the descriptions of keys; what writes schemas has them."""

import subprocess
import sys

import pytest

from experiments.declaration.experiment import Experiment

TOLD = (
    "from experiments.declaration.experiment import Experiment as E; "
    "print(E.model_fields['name'].description)"
)
ALONE = "from analysis import cli; cli.run_command_line = lambda app: None; cli.main(); "


@pytest.mark.parametrize(
    ("before", "said"), [("", Experiment.model_fields["name"].description), (ALONE, None)]
)
def test_descriptions_are_read_where_they_are_given(before: str, said: str | None) -> None:
    done = subprocess.run([sys.executable, "-c", before + TOLD], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == str(said)
