"""Text from outside is printed as it is: no program reads it as markup."""

import ast
from pathlib import Path

import pytest
from typer.testing import CliRunner

PACKAGES = ("analysis", "experiments", "server", "stimuli_builder", "table_files", "video_conversion")
PRINTERS = ("Console", "TextColumn")
"""What reads square brackets in a text as markup unless it is switched off."""
ROOT = Path(__file__).parents[1]


def calls(path: Path) -> list[ast.Call]:
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    return [node for node in nodes if isinstance(node, ast.Call)]


def called(node: ast.Call) -> str:
    return node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")


def modules() -> list[Path]:
    return [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]


def test_every_console_and_text_column_has_markup_switched_off() -> None:
    found, faults = 0, []
    for path in modules():
        for node in calls(path):
            if called(node) not in PRINTERS:
                continue
            found += 1
            switched = [word.value for word in node.keywords if word.arg == "markup"]
            if not (switched and isinstance(switched[0], ast.Constant) and switched[0].value is False):
                faults.append(f"{path.relative_to(ROOT)}:{node.lineno}")
    assert found > 10
    assert faults == []


def test_no_spinner_is_given_a_text_that_it_reads_as_markup() -> None:
    """A spinner reads every string as markup, whatever its console does; a `Text` it takes as it is."""
    faults = [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for path in modules()
        for node in calls(path)
        if called(node) in ("status", "update") and any(isinstance(one, ast.JoinedStr) for one in node.args)
    ]
    assert faults == []


def test_nothing_asks_for_markup() -> None:
    faults = [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for path in modules()
        for node in calls(path)
        if called(node) == "from_markup"
    ]
    assert faults == []


@pytest.mark.parametrize("name", ["left [mm]", "left [/mm]", "[bold]left", "left [/]", "[red]x[/red] \\[y]"])
def test_a_column_is_named_as_it_is_by_the_blinks_command(name: str, tmp_path: Path) -> None:
    import numpy as np
    import pandas as pd

    from stimuli_builder.cli import app

    times = np.arange(1200) / 120
    value = 10 * (1 - np.exp(-(((times % 3 - 1.5) / 0.06) ** 2)))
    pd.DataFrame({"time_s": times, name: value}).to_csv(tmp_path / "s.csv", index=False)
    command = ["blinks", str(tmp_path / "s.csv"), "--column", name, "--out", str(tmp_path / "b.csv")]
    ended = CliRunner().invoke(app, command, env={"COLUMNS": "300"})
    assert ended.exit_code == 0, ended.output
    assert name in ended.output


@pytest.mark.parametrize("title", ["Lids [mm]", "Lids [/mm]", "[red]Lids"])
def test_a_plan_names_studies_and_levels_as_they_are(title: str, capsys: pytest.CaptureFixture[str]) -> None:
    from stimuli_builder.clips.plan import print_plan

    plan = {
        "name": "study",
        "title": title,
        "participants": 2,
        "factors": [{"name": "unit", "levels": [{"name": title}]}],
        "cells": [1],
        "exemplars_per_cell": 1,
        "unique_clips": 1,
        "trials_per_participant": 1,
        "blocks": [{"label": "all", "trials": 1}],
        "order": "random",
        "expected_minutes": 1,
        "practice_trials": 0,
        "notes": [f"note on {title}"],
        "repeated_profiles": [],
    }
    print_plan(plan)
    printed = " ".join(capsys.readouterr().out.split())
    assert printed.count(title) == 3


@pytest.mark.parametrize("text", ["study [mm]", "study [/mm]", "[red]study", "a\\[b]"])
def test_the_server_prints_names_as_they_are(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    from server.cli_common import out

    with out.capture() as captured:
        out.print(f"study {text}: there")
    assert text in captured.get()


@pytest.mark.parametrize("text", ["step [mm]", "step [/mm]"])
def test_the_spinner_of_analysis_shows_steps_as_they_are(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    import io

    from analysis.commands.output import progress_spinner

    stream = io.StringIO()
    stream.isatty = lambda: True  # type: ignore[method-assign]
    monkeypatch.setattr("sys.stderr", stream)
    monkeypatch.setenv("TERM", "xterm")
    with progress_spinner(text) as say:
        say(text)
    assert text in stream.getvalue()
