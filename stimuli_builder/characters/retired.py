"""Characters that left the tree: a study made with one renders the same bytes once it is fetched."""

import shutil
import subprocess
import tarfile
import tempfile
import tomllib
from io import BytesIO
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field

from experiments.errors import InputError, did_you_mean
from stimuli_builder.characters.atlas import SHIPPED, load_atlas
from stimuli_builder.characters.declaration import DECLARATION_FILE

RETIRED_FILE = Path(__file__).with_name("retired.toml")
ROOT = Path(__file__).resolve().parents[2]


class Retired(BaseModel):
    """Where a character lies in the repository's history, and the fingerprint of its pictures."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    label: str
    commit: str = Field(pattern="^[0-9a-f]{40}$")
    folder: str
    sha256: str = Field(pattern="^[0-9a-f]{64}$")


def load_retired() -> dict[str, Retired]:
    """Every retired character by name."""
    content = tomllib.loads(RETIRED_FILE.read_text(encoding="utf-8"))
    return {name: Retired.model_validate(table) for name, table in content.items()}


def next_version(name: str) -> int:
    """The version that no character of that name has, here or in earlier releases; 1 for a new name."""
    known = {folder.name for folder in SHIPPED.iterdir()} | set(load_retired())
    numbers = [other.partition("@")[2] for other in known if other.partition("@")[0] == name]
    return max((int(number) if number.isdecimal() else 1 for number in numbers), default=0) + 1


# Decision 0695: A character's name means the same pictures for ever.
def restore(name: str, source: Path | None, target: Path) -> Path:
    """Put a retired character into the folder `target`, whole or not at all; returns that folder.

    Raises
    ------
    InputError
        There is no such character, the source does not hold it, its pictures are others than they were,
        or the folder cannot be written.
    """
    known = load_retired()
    if name not in known:
        raise InputError(f"there is no retired character '{name}'{did_you_mean(name, known)}")
    retired = known[name]
    if (target / DECLARATION_FILE).is_file():
        _check(name, retired, target)
        return target
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=f".{name}-", dir=target.parent) as folder:
            draft = Path(folder) / "character"
            _take(name, retired, source or ROOT, draft)
            _check(name, retired, draft)
            draft.replace(target)
    except OSError as error:
        raise InputError(
            f"cannot write {target}: {error.strerror}; choose another folder with --out and use it as the "
            "character"
        ) from error
    return target


def _take(name: str, retired: Retired, source: Path, draft: Path) -> None:
    for folder in (source / retired.folder, source):
        if (folder / DECLARATION_FILE).is_file():
            shutil.copytree(folder, draft)
            return
    with tarfile.open(fileobj=BytesIO(_archive(name, retired, source))) as tar:
        # Python before 3.11.4 has no filters; the archive is git's own.
        if hasattr(tarfile, "data_filter"):
            tar.extractall(draft.parent, filter="data")
        else:
            tar.extractall(draft.parent)  # noqa: S202
    (draft.parent / retired.folder).replace(draft)


def _archive(name: str, retired: Retired, source: Path) -> bytes:
    """The character's folder as the commit that made it had it, in a tar file."""
    command = ["git", "-C", str(source), "archive", "--format=tar", retired.commit, retired.folder]
    try:
        done = subprocess.run(command, capture_output=True, check=False)  # noqa: S603 - fixed arguments
    except OSError as error:
        raise InputError(f"fetching '{name}' needs git, which was not found: {error.strerror}") from error
    if done.returncode:
        said = (done.stderr.decode(errors="replace").strip().splitlines() or ["no message"])[-1]
        raise InputError(
            f"{source} does not contain '{name}' ({said}): use --from with a complete clone of Palpebra "
            "(complete it with `git fetch --unshallow`) or an earlier release"
        )
    return done.stdout


def _check(name: str, retired: Retired, folder: Path) -> None:
    if load_atlas(folder).fingerprint() != retired.sha256:
        raise InputError(
            f"'{name}' in {folder} differs from the one in earlier releases: its pictures have another "
            "SHA-256; use an unchanged clone or release"
        )
