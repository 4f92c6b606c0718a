"""A command that writes a file or folder creates the folders above it; a refused one creates none."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from analysis.cli import app as analysis
from experiments.errors import InputError
from stimuli_builder.cli import app as stimuli
from tests.docs.commands_inputs import write_inputs

TABLE = "--participant id --rating score"
WRITERS = [
    (stimuli, "performance --duration 5 --out OUT.csv"),
    (stimuli, "model sample --count 2 --out OUT.csv --plot OUT.png"),
    (stimuli, "model textbook --out OUT.csv --plot OUT.svg"),
    (stimuli, "model export --out OUT.py --format blender"),
    (stimuli, "profiles plot OUT.png"),
    (stimuli, "actor --seconds 1 --out OUT.mp4 --truth OUT.csv"),
    (stimuli, "clip --profile AL_ease --duration 9 --character cartoon --out OUT.mp4"),
    (stimuli, "siti recordings --out OUT.csv"),
    (stimuli, "blinks series.csv --column EAR_l --fps 240 --out OUT.csv --report OUT.html"),
    (analysis, "synthesise exp1 --out OUT.csv"),
    (analysis, f"anova ratings.csv {TABLE} --within face --json OUT.json"),
    (analysis, "reliability items.csv --items q1,q2,q3 --json OUT.json --scores OUT.csv"),
    (analysis, "plan anova --within face:3 --effect face=0.25 --n 10:20:10 --plot OUT.png"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("inputs")
    write_inputs(made)
    return made


@pytest.mark.parametrize(("program", "command"), WRITERS, ids=[command[:25] for _, command in WRITERS])
def test_missing_folders_are_created(program, command, folder, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(folder)
    target = tmp_path / "new" / "folder" / "out"
    result = CliRunner().invoke(program, command.replace("OUT", str(target)).split())
    assert result.exit_code == 0, f"{result.output}{result.exception}"
    wanted = [word.replace("OUT", str(target)) for word in command.split() if word.startswith("OUT")]
    assert all(Path(name).stat().st_size > 0 for name in wanted)


@pytest.mark.parametrize(
    ("program", "command"),
    [
        (stimuli, "blinks none.csv --column EAR_l --fps 240 --out OUT.csv"),
        (stimuli, "performance none.wav --out OUT.csv"),
        (stimuli, "clip --profile none --character cartoon --out OUT.mp4"),
        (analysis, f"anova none.csv {TABLE} --within face --out OUT --json OUT.json"),
    ],
)
def test_a_refused_command_creates_no_folder(program, command, folder, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(folder)
    result = CliRunner().invoke(program, command.replace("OUT", str(tmp_path / "new" / "out")).split())
    assert isinstance(result.exception, InputError)
    assert not (tmp_path / "new").exists()


def test_a_file_above_the_output_is_refused_before_the_work(folder, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(folder)
    (tmp_path / "file").write_text("")
    out = tmp_path / "file" / "new" / "blinks.csv"
    result = CliRunner().invoke(stimuli, ["performance", "--duration", "5", "--out", str(out)])
    assert f"expected a folder, but {tmp_path / 'file'} is a file" in str(result.exception)
