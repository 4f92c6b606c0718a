"""The folder of an experiment's clips: what a former build left there, and what goes wrong in it."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from experiments.definition import Experiment
from experiments.errors import InputError
from experiments.manifest import MANIFEST_NAME, Manifest, read_manifest
from stimuli_builder.clips.state import BuildState


def former_manifest(experiment: Experiment, folder: Path) -> Manifest | None:
    """The manifest of the build before, None where there is none; InputError where it is another study's."""
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: expected a folder for the clips, this is a file; choose another name")
    if not (folder / MANIFEST_NAME).exists():
        return None
    former = read_manifest(folder)
    if former.experiment != experiment.name:
        raise InputError(
            f"{folder} holds the clips of '{former.experiment}', not of '{experiment.name}'; "
            "choose another folder"
        )
    return former


def stale(former: Manifest | None, manifest: Manifest) -> tuple[str, ...]:
    """Files that a build made and the new manifest does not name; clips that came from elsewhere stay."""
    if former is None:
        return ()
    current = {clip.file for clip in manifest.files}
    made = {clip.file for clip in former.files if clip.file == f"{clip.sha256}.mp4"}
    return tuple(sorted(made - current))


@contextmanager
def readable_failures(folder: Path, state: BuildState) -> Iterator[None]:
    """Make the folder; an interruption or a full disk ends in one line that says how to go on."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except KeyboardInterrupt as error:
        raise InputError(
            f"interrupted; {state.count} clips are finished in {folder}, the same command goes on from there"
        ) from error
    except OSError as error:
        raise InputError(
            f"{folder} cannot be written ({error.strerror or error}); {state.count} clips are finished, "
            "make room and run the same command again"
        ) from error
