"""What the Dockerfile says, without building it; tools/dockerfile_steps.py does its steps."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import REPOSITORY
from tools.dockerfile_steps import Stage, parse

SHELL_SCRIPTS = sorted((REPOSITORY / "deploy").glob("*.sh"))


@pytest.fixture(scope="module")
def stages() -> list[Stage]:
    return parse((REPOSITORY / "Dockerfile").read_text(encoding="utf-8"))


def reaches_the_build(source: str) -> bool:
    """Whether a file or folder is there, and .dockerignore lets it or a folder above it in."""
    lines = (REPOSITORY / ".dockerignore").read_text(encoding="utf-8").splitlines()
    let_in = {Path(line.removeprefix("!")) for line in lines if line.startswith("!")}
    path = Path(source)
    return (REPOSITORY / path).exists() and bool({path, *path.parents} & let_in) and source not in lines


def test_what_dockerignore_keeps_out_does_not_reach_the_build() -> None:
    assert reaches_the_build("deploy/s3.lock")
    assert not reaches_the_build("requirements-dev.lock")
    assert not reaches_the_build("frontend/dist")


def test_everything_copied_is_in_the_repository_or_an_earlier_stage(stages: list[Stage]) -> None:
    earlier: set[str] = set()
    for stage in stages:
        for step in stage.steps:
            if step.word == "COPY":
                for source in step.sources:
                    assert step.stage in earlier if step.stage else reaches_the_build(source), step
        earlier.add(stage.name)


def test_what_runs_is_not_root_and_has_no_building_tools(stages: list[Stage]) -> None:
    last = {step.word: step.text for step in stages[-1].steps}
    assert last["USER"] == "10001:10001"
    assert last["ENTRYPOINT"] == '["python", "-m", "server"]'
    assert "HEALTHCHECK" in last
    assert "RUN" not in last
    assert all(re.search(r":\d+\.\d+\.\d+-slim$", stage.image) for stage in stages)


def test_packages_are_installed_by_hash(stages: list[Stage]) -> None:
    runs = [step.text for stage in stages for step in stage.steps if step.word == "RUN"]
    [install] = [run for run in runs if "-r requirements.lock -r s3.lock" in run]
    assert "--require-hashes" in install
    assert any(run.startswith("npm ci") for run in runs)
    lock = (REPOSITORY / "deploy" / "s3.lock").read_text(encoding="utf-8")
    assert "\nboto3==" in lock


@pytest.mark.parametrize("script", SHELL_SCRIPTS, ids=lambda path: path.name)
def test_the_scripts_are_shell(script: object) -> None:
    shell = shutil.which("sh")
    if shell is None or sys.platform == "win32":
        pytest.skip("no shell here")
    assert subprocess.run([shell, "-n", str(script)], check=False).returncode == 0


def test_the_proxy_keeps_operations_and_addresses_to_itself() -> None:
    text = (REPOSITORY / "deploy" / "Caddyfile").read_text(encoding="utf-8")
    assert "@operations path /metrics /readyz" in text
    assert "respond @operations 404" in text
    assert "\n\tlog" not in text
    assert "reverse_proxy server:8000" in text
    assert text.count("{") == text.count("}")
