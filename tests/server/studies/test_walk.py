"""The walk of docs/how-to/build-a-study.md from a folder of clips to a link, as the page describes it."""

import re
import shlex
from pathlib import Path

import pytest

from server.core.settings import Settings
from stimuli_builder.cli import main
from tests.helpers.databases import run_server_command
from tests.helpers.tiny_clips import encoded_video

REPOSITORY = Path(__file__).resolve().parents[3]
GUIDE = (REPOSITORY / "docs" / "how-to" / "build-a-study.md").read_text(encoding="utf-8")
WALK = GUIDE.partition("## A folder of clips, on the command line")[2].partition("\n## ")[0]


def block(language: str) -> str:
    return WALK.partition(f"```{language}\n")[2].partition("```")[0]


@pytest.mark.usefixtures("services")
def test_the_walk_from_a_folder_of_clips_to_a_link(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, settings: Settings
) -> None:
    (tmp_path / "recordings").mkdir()
    names = re.findall(r"`(\w+\.mp4)`", WALK)
    assert len(names) == 6
    for number, name in enumerate(names):
        own = bytes([0, 0, 0, 9]) + b"free" + bytes([number])
        (tmp_path / "recordings" / name).write_bytes(encoded_video(4, 30) + own)
    (tmp_path / "motion.toml").write_text(block("toml"), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    manifest, add, link, run = (shlex.split(line, comments=True) for line in block("sh").splitlines())
    monkeypatch.setattr("sys.argv", manifest)
    with pytest.raises(SystemExit) as end:
        main()
    assert not end.value.code
    for command in (add, link):
        assert command[0] == "server"
        done = run_server_command(settings, *command[1:])
        assert done.returncode == 0, done.stderr
        assert re.search(r"http://localhost:8000/run/[\w-]{22}$", done.stdout.strip())
    assert run == ["server", "run"]
