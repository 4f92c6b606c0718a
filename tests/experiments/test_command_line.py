"""Every way a command line can be called wrongly ends in one line that says what to do."""

import subprocess
import sys
from pathlib import Path

import pytest
import typer

from experiments.command_line import run_command_line

BIN = Path(sys.executable).parent


def test_a_question_that_nobody_answers_is_not_a_traceback(capsys: pytest.CaptureFixture[str]) -> None:
    def asks(**_options: object) -> None:
        raise typer.Abort

    with pytest.raises(SystemExit) as ended:
        run_command_line(asks)
    assert ended.value.code == 1
    assert capsys.readouterr().err == "stopped: the question was not answered with yes\n"


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (("analysis", "anova", "--nope"), "No such option: --nope"),
        (("analysis", "anvoa"), "anvoa"),
        (("stimuli", "build"), "Missing argument 'experiment'; see stimuli build --help"),
        (
            ("stimuli", "clip", "--fps", "fast", "--out", "x.mp4"),
            "expected a whole number, got 'fast'",
        ),
        (("server", "run", "--port", "abc"), "--port: expected a whole number, got 'abc'"),
        (("server", "simulate", "exp3", "--participants", "0"), "expected 1 or more, got '0'; see server"),
        (("analysis", "plan", "anova", "--statistic", "wilks"), "--statistic: 'wilks' is not one of 'multi"),
    ],
)
def test_a_wrong_call_is_one_line(call: tuple[str, ...], line: str, tmp_path: Path) -> None:
    ran = subprocess.run(
        [BIN / call[0], *call[1:]], capture_output=True, text=True, cwd=tmp_path, check=False
    )
    assert ran.returncode == 2
    assert ran.stderr.startswith("error: ")
    assert ran.stderr.count("\n") == 1
    assert line in ran.stderr
    assert not ran.stdout
