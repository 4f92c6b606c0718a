"""`stimuli build`: the factorial set of an experiment as clips and `manifest.json`."""

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

from experiments.declaration.experiment import Experiment
from experiments.kinds import KINDS
from experiments.manifest import MANIFEST_NAME, Manifest
from experiments.schema.canonical import definition_sha256
from stimuli_builder.characters.declaration import write_bytes
from stimuli_builder.checks import plan as checks
from stimuli_builder.checks.plan import planned_checks
from stimuli_builder.clips.design_clips import Options, PlannedClip, planned_clips
from stimuli_builder.clips.folder import (
    BuildState,
    Built,
    assemble,
    former_manifest,
    manifest_text,
    readable_failures,
    stale,
)
from stimuli_builder.clips.jobs import available_cores, run_jobs

Progress = Callable[[int, int], None]
"""Called with the clips done and the clips to do."""


def silent(_done: int, _total: int) -> None:
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
    hash it had. Clips of the former manifest that the new one does not name are removed. Motion checks keep
    the seed of the former manifest.

    Raises
    ------
    InputError
        The design cannot be analyzed or rendered, the folder belongs to another experiment or cannot be
        written, or the build was interrupted; what is built by then is kept and used by the next run.
    """
    options, machines = options or Options(), machines or Machines()
    KINDS[experiment.trial.kind].plan(experiment)
    former = former_manifest(experiment, folder)
    planned = planned_clips(experiment, options)
    seed = checks.seed_for(folder, former, options)
    asked = planned_checks(experiment, seed, options)
    state = BuildState.read(folder, former)
    missing, missing_checks = _missing(planned, state), checks.missing_checks(asked, state)
    to_build = len(missing) + len(missing_checks)
    progress(0, to_build)
    with readable_failures(folder, state), state.recording():
        if asked:
            checks.keep_seed(folder, seed)
        made = chain(_rendered(missing, folder, machines), checks.rendered_checks(missing_checks, folder))
        for done, built in enumerate(made, start=1):
            state.add(built)
            progress(done, to_build)
        manifest = assemble(experiment, definition_sha256(experiment), options, planned, state)
        manifest = checks.with_checks(manifest, asked, seed, state)
        removed = stale(former, manifest)
        if former != manifest:
            write_bytes(folder / MANIFEST_NAME, manifest_text(manifest).encode())
    # After the new manifest: an interruption must not leave one whose files are gone.
    for name in removed:
        (folder / name).unlink(missing_ok=True)
    checks.finish_checks(folder, state)
    inputs = {clip.job.input_hash for clip in planned} | {one.job.input_hash for one in asked}
    return Report(manifest, to_build, len(inputs) - to_build, removed)


def _missing(planned: list[PlannedClip], state: BuildState) -> list[PlannedClip]:
    """The clips to render, each input once."""
    # Reversed twice: of clips with equal inputs the first of the design is kept, at the place of the last.
    by_hash = {clip.job.input_hash: clip for clip in reversed(planned)}
    return [clip for key, clip in reversed(by_hash.items()) if not state.intact(key)]


def _rendered(missing: list[PlannedClip], folder: Path, machines: Machines) -> Iterator[Built]:
    jobs = [clip.job for clip in missing]
    workers = machines.workers or available_cores()
    for index, content in run_jobs(jobs, workers, machines.dask):
        sha256 = hashlib.sha256(content).hexdigest()
        name = f"{sha256}.mp4"
        write_bytes(folder / name, content)
        yield Built(jobs[index].input_hash, name, sha256, len(content), jobs[index].frames)
