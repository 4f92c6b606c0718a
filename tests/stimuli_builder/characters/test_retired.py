"""A character that left the tree comes back byte for byte, or one line says why not."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from experiments.errors import InputError
from stimuli_builder.characters import atlas
from stimuli_builder.characters.atlas import (
    ROOT,
    SHIPPED,
    Retired,
    load_atlas,
    load_retired,
    next_version,
    restore,
)
from stimuli_builder.characters.cli import list_characters
from stimuli_builder.clips.characters import find_character, geometry, shipped_names

FOLDER = "pictures/old"
OPENING_MM = {
    "photorealistic": 11.0,
    "alder@2": 10.07,
    "alder": 10.07,
    "alder@3": 10.07,
    "alder@4": 10.07,
    "alder@5": 10.07,
    "alder@6": 10.07,
    "alder@7": 10.07,
    "hazel@4": 10.91,
    "cedar@5": 9.45,
    "alder@9": 9.21,
    "birch@7": 9.35,
    "hazel@5": 10.91,
    "cedar-face@2": 9.85,
    "alder-face@2": 10.07,
    "cedar-face@3": 9.45,
    "alder-face@3": 9.21,
    "hazel@6": 9.81,
    "cedar@6": 9.45,
    "birch@8": 9.35,
    "alder@10": 9.21,
    "alder-face": 10.07,
    "birch": 9.66,
    "birch@3": 9.66,
    "birch@4": 9.66,
    "birch@5": 9.66,
    "cedar": 9.85,
    "cedar@3": 9.85,
    "cedar-face": 9.85,
    "hazel": 10.91,
    "hazel@3": 10.91,
}
"""Of the eyes of each character that has left, as its declaration has it."""


@pytest.fixture
def repository(tiny_character: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A clone whose last commit deleted a character that the one before had."""
    clone = tmp_path / "clone"
    shutil.copytree(tiny_character, clone / FOLDER)

    def git(*words: str) -> str:
        command = ["git", "-C", str(clone), "-c", "user.name=a", "-c", "user.email=a@b.c", *words]
        return subprocess.run(command, capture_output=True, check=True, text=True).stdout.strip()

    git("init", "-q")
    git("add", "-A")
    git("commit", "-qm", "with")
    commit = git("rev-parse", "HEAD")
    git("rm", "-rq", "pictures")
    git("commit", "-qm", "without")
    old = Retired(label="old", commit=commit, folder=FOLDER, sha256=load_atlas(tiny_character).fingerprint())
    monkeypatch.setattr(atlas, "load_retired", lambda: {"old": old})
    return clone


def test_it_comes_out_of_the_history_byte_for_byte(
    repository: Path, tiny_character: Path, tmp_path: Path
) -> None:
    folder = restore("old", repository, tmp_path / "data" / "old")
    assert {file.name: file.read_bytes() for file in folder.iterdir()} == {
        file.name: file.read_bytes() for file in tiny_character.iterdir()
    }
    assert [file.name for file in folder.parent.iterdir()] == ["old"]
    assert restore("old", tmp_path / "nowhere", folder) == folder  # there already


def test_it_comes_out_of_an_earlier_release(repository: Path, tiny_character: Path, tmp_path: Path) -> None:
    release = tmp_path / "release"
    shutil.copytree(tiny_character, release / FOLDER)
    assert restore("old", release, tmp_path / "a" / "old").is_dir()
    assert restore("old", tiny_character, tmp_path / "b" / "old").is_dir()


@pytest.mark.parametrize("kind", ["zip", "gztar"])
@pytest.mark.parametrize("top", ["", "palpebra-0.1.0"])
def test_it_comes_out_of_a_release_file(
    repository: Path, tiny_character: Path, tmp_path: Path, kind: str, top: str
) -> None:
    shutil.copytree(tiny_character, tmp_path / "release" / top / FOLDER)
    file = Path(shutil.make_archive(str(tmp_path / "palpebra"), kind, tmp_path / "release"))
    # A wheel is a zip file, whatever its name.
    folder = restore("old", file.rename(tmp_path / "palpebra.whl"), tmp_path / "data" / "old")
    assert {one.name: one.read_bytes() for one in folder.iterdir()} == {
        one.name: one.read_bytes() for one in tiny_character.iterdir()
    }


def test_a_file_that_is_no_release_is_one_line(
    repository: Path, tiny_character: Path, tmp_path: Path
) -> None:
    wrong, other = tmp_path / "notes.zip", tmp_path / "other"
    wrong.write_text("no archive")
    (other / "pictures").mkdir(parents=True)
    empty = Path(shutil.make_archive(str(tmp_path / "empty"), "zip", other))
    cut = Path(shutil.make_archive(str(tmp_path / "cut"), "gztar", repository))
    cut.write_bytes(cut.read_bytes()[:-200])
    spoiled = Path(shutil.make_archive(str(tmp_path / "spoiled"), "xztar", repository))
    content = bytearray(spoiled.read_bytes())
    content[len(content) // 2] ^= 255
    spoiled.write_bytes(content)
    shutil.copytree(tiny_character, tmp_path / "held" / FOLDER)
    secret = Path(shutil.make_archive(str(tmp_path / "secret"), "zip", tmp_path / "held"))
    # The flag of encryption in each entry of the directory at the end.
    secret.write_bytes(re.sub(rb"(PK\x01\x02.{4}).", b"\\g<1>\x01", secret.read_bytes(), flags=re.DOTALL))
    for file, said in (
        (wrong, "expected a release file"),
        (empty, "does not contain 'old'"),
        (cut, "expected a release file"),
        (spoiled, "expected a release file"),
        (secret, "expected a release file"),
    ):
        with pytest.raises(InputError, match=said):
            restore("old", file, tmp_path / "data" / "old")
    assert not (tmp_path / "data" / "old").exists()


def test_other_pictures_than_it_had_are_refused_and_nothing_stays(
    repository: Path, tiny_character: Path, tmp_path: Path
) -> None:
    file = tiny_character / "character.toml"
    file.write_text(file.read_text() + "\n# changed\n")
    with pytest.raises(InputError, match="differs from the one in earlier releases"):
        restore("old", tiny_character, tmp_path / "data" / "old")
    assert not list((tmp_path / "data").iterdir())


def test_the_next_version_is_one_that_nobody_has() -> None:
    """Other pictures than those that ship or have left are another character."""
    taken = {*load_retired(), *(folder.name for folder in SHIPPED.iterdir())}
    for name in ("alder", "birch", "hazel"):
        version = next_version(name)
        assert version > 1
        assert f"{name}@{version}" not in taken
        assert version == 2 or f"{name}@{version - 1}" in taken
    assert next_version("nobody") == 1


@pytest.mark.parametrize(
    ("name", "said"),
    [("odl", "no retired character 'odl'; did you mean 'old'"), ("old", "does not contain 'old'")],
)
def test_what_cannot_be_had_is_one_line(repository: Path, tmp_path: Path, name: str, said: str) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(InputError, match=said) as raised:
        restore(name, empty, tmp_path / "data" / "old")
    assert "\n" not in str(raised.value)


def test_a_study_that_asks_for_one_gets_the_command() -> None:
    for name in load_retired():
        if not (ROOT / "stimuli_builder" / "characters" / "data" / name).exists():
            with pytest.raises(InputError, match=f"`stimuli character fetch {name}`"):
                find_character(name)


@pytest.mark.parametrize("name", sorted(load_retired()))
def test_every_retired_character_is_in_this_clones_history(tmp_path: Path, name: str) -> None:
    known = load_retired()[name]
    held = subprocess.run(
        ["git", "-C", str(ROOT), "cat-file", "-e", known.commit], capture_output=True, check=False
    )
    if held.returncode:
        pytest.skip(f"this checkout is not a whole clone: its history lacks commit {known.commit[:7]}")
    atlas = load_atlas(restore(name, None, tmp_path / name))
    assert atlas.fingerprint() == known.sha256
    assert atlas.declaration.opening_mm == OPENING_MM[name]


def test_the_list_is_of_what_is_installed(capsys: pytest.CaptureFixture[str]) -> None:
    list_characters()
    shown = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in shown[:-1]] == list(shipped_names())
    earlier = set(load_retired()) - set(shipped_names())
    assert shown[-1].startswith(f"{len(earlier)} characters of earlier releases can be restored")
    list_characters(every=True)
    everything = capsys.readouterr().out.splitlines()
    assert {line.split()[0] for line in everything[:-1]} == {*shipped_names(), *earlier}


@pytest.mark.parametrize(
    ("left", "next_of_it"), [("alder-face", r"alder-face@\d+"), ("photorealistic", "alder@8")]
)
def test_a_character_that_left_is_answered_with_the_newest_of_its_name(left: str, next_of_it: str) -> None:
    with pytest.raises(InputError, match=f"for a new study use another, such as '{next_of_it}'"):
        geometry(left)
