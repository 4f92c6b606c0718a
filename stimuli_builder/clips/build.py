"""`stimuli build`: the factorial set of an experiment as clips and `manifest.json`."""

import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from experiments.definition import Experiment
from experiments.errors import InputError
from experiments.manifest import MANIFEST_NAME, Clip, Manifest, read_manifest
from experiments.schema.canonical import definition_sha256
from experiments.trials import KINDS
from stimuli_builder.characters.writing import write_bytes
from stimuli_builder.clips.design_clips import Options, PlannedClip, planned_clips
from stimuli_builder.clips.manifest_file import assemble, manifest_text
from stimuli_builder.clips.state import BuildState, Built
from stimuli_builder.clips.workers import available_cores, run_jobs

Progress = Callable[[int, int], None]
"""Called with the clips done and the clips to do."""


def silent(_done: int, _wanted: int) -> None:
    """Progress that nobody watches."""


@dataclass(frozen=True)
class Machines:
    """Where clips are rendered: `workers` processes here (None: one a core), or a Dask cluster."""

    workers: int | None = None
    dask: str | None = None


@dataclass(frozen=True)
class Report:
    """What a build did."""

    manifest: Manifest
    built: int
    reused: int
    removed: tuple[str, ...] = field(default=())


def build(
    experiment: Experiment,
    folder: Path,
    options: Options | None = None,
    machines: Machines | None = None,
    progress: Progress = silent,
) -> Report:
    """Build what is missing or changed of an experiment's clips and write the manifest last.

    A clip counts as there when a clip with the same inputs was built before and its file still has the
    hash it had. Clips of the former manifest that the new one does not name are removed.

    Raises
    ------
    InputError
        The design cannot be analysed or rendered, the folder belongs to another experiment or cannot be
        written, or the build was interrupted; what is built by then is kept and used by the next run.
    """
    options, machines = options or Options(), machines or Machines()
    KINDS[experiment.trial.kind].plan(experiment)
    former = _former_manifest(experiment, folder)
    planned = planned_clips(experiment, options)
    state = BuildState.read(folder, former)
    missing = _missing(planned, state)
    progress(0, len(missing))
    with _readable_failures(folder, state), state.recording():
        for done, built in enumerate(_rendered(missing, folder, machines), start=1):
            state.add(built)
            progress(done, len(missing))
        manifest = assemble(experiment, definition_sha256(experiment), options, planned, state)
        removed = _stale(former, manifest)
        if former != manifest:
            write_bytes(folder / MANIFEST_NAME, manifest_text(manifest).encode())
    for name in removed:
        (folder / name).unlink(missing_ok=True)
    state.finish()
    return Report(
        manifest, len(missing), len({clip.job.input_hash for clip in planned}) - len(missing), removed
    )


def _former_manifest(experiment: Experiment, folder: Path) -> Manifest | None:
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


def _missing(planned: list[PlannedClip], state: BuildState) -> list[PlannedClip]:
    """The clips to render, each input once."""
    wanted = {clip.job.input_hash: clip for clip in reversed(planned)}
    return [clip for key, clip in reversed(wanted.items()) if not state.intact(key)]


def _rendered(missing: list[PlannedClip], folder: Path, machines: Machines) -> Iterator[Built]:
    jobs = [clip.job for clip in missing]
    workers = machines.workers or available_cores()
    for index, content in run_jobs(jobs, workers, machines.dask):
        sha256 = hashlib.sha256(content).hexdigest()
        name = f"{sha256}.mp4"
        write_bytes(folder / name, content)
        yield Built(jobs[index].input_hash, name, sha256, len(content), jobs[index].frames)


def _stale(former: Manifest | None, manifest: Manifest) -> tuple[str, ...]:
    if former is None:
        return ()
    current = {clip.file for clip in manifest.clips}
    return tuple(sorted({clip.file for clip in former.clips if _is_ours(clip)} - current))


def _is_ours(clip: Clip) -> bool:
    return clip.file == f"{clip.sha256}.mp4"


@contextmanager
def _readable_failures(folder: Path, state: BuildState) -> Iterator[None]:
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
