"""Which check clips a study declares, and the clips and manifest rows made of them."""

import hashlib
import secrets
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from experiments import design
from experiments.assignment.order import motion_checks_by_block
from experiments.checks import CHECK_KINDS, CheckName
from experiments.declaration.experiment import Experiment
from experiments.declaration.rendering import RenderSettings
from experiments.errors import InputError
from experiments.manifest import MANIFEST_NAME, CheckClip, Manifest
from stimuli_builder.characters.declaration import write_bytes
from stimuli_builder.checks.jobs import CheckJob
from stimuli_builder.clips.characters import geometry
from stimuli_builder.clips.curves import generator
from stimuli_builder.clips.design_clips import Options, look_of
from stimuli_builder.clips.folder import (
    RENDER_KEY,
    BuildState,
    Built,
    former_manifest,
    manifest_text,
    readable_failures,
    stale,
)

# Which check clips a study declares: kinds in turn, everything else drawn from the seed.


@dataclass(frozen=True)
class PlannedCheck:
    """A check's clip with all that decides it.

    Attributes
    ----------
    width_mm : float
        Shown width at actual size.
    """

    job: CheckJob
    width_mm: float


def planned_checks(experiment: Experiment, seed: int, options: Options) -> list[PlannedCheck]:
    """The clips of an experiment's motion checks in order; none where no block asks for any."""
    declared = experiment.evidence.motion_checks
    if not any(motion_checks_by_block(experiment)):
        return []
    kinds = declared.kinds
    return [
        _planned(experiment, kinds[(number - 1) % len(kinds)], number, seed, options)
        for number in range(1, declared.clips + 1)
    ]


def _planned(
    experiment: Experiment, check: CheckName, number: int, seed: int, options: Options
) -> PlannedCheck:
    declared = experiment.evidence.motion_checks
    settings = _settings(experiment, seed, number, options.base_folder)
    look = look_of(settings, options) if CHECK_KINDS[check].own_look else None
    job = CheckJob(
        check=check,
        number=number,
        seed=seed,
        difficulty=declared.difficulty,
        contrast=declared.contrast,
        seconds=declared.seconds,
        fps=settings.fps,
        background=bt709(experiment.display.background),
        look=look,
    )
    scale = geometry(settings.character, options.base_folder).px_per_mm_at(settings.width_px)
    return PlannedCheck(job, round(job.size_px[0] / scale, 4))


UNDECLARED = RenderSettings().character
"""The character of a study that names none."""


def _settings(experiment: Experiment, seed: int, number: int, base: Path | None) -> RenderSettings:
    """How a cell drawn by the seed is rendered: its character, size and rate are the check's."""
    clips = design.clips(experiment)
    drawn = generator("check", seed, number, "cell").integers(len(clips))
    settings = design.render_settings(experiment, clips[int(drawn)])
    if settings.character == UNDECLARED and not _is_there(UNDECLARED, base):
        # A study of own clips declares no character, and the default is no longer shipped.
        return settings.model_copy(update={"character": "cartoon"})
    return settings


def _is_there(character: str, base: Path | None) -> bool:
    try:
        geometry(character, base)
    except InputError:
        return False
    return True


def bt709(colour: str) -> tuple[int, int, int]:
    """`#rrggbb` as limited-range BT.709 Y, Cb, Cr, 8 bits each (ITU-R BT.709-6, items 3.2 to 3.5)."""
    red, green, blue = (int(colour[digit : digit + 2], 16) / 255 for digit in (1, 3, 5))
    luma = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    return (
        round(16 + 219 * luma),
        round(128 + 224 * (blue - luma) / 1.8556),
        round(128 + 224 * (red - luma) / 1.5748),
    )


# `stimuli checks`, and the checks of `stimuli build`: the clips and their rows of the manifest.

SEED_NAME = ".checks-seed"
"""In the manifest's folder while checks are made: the seed, so that an interrupted build continues with
it."""
SEED_BITS = 53
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class ChecksReport:
    """What was made of checks."""

    manifest: Manifest
    built: int
    removed: tuple[str, ...]


def build_checks(
    experiment: Experiment, folder: Path, options: Options, progress: Progress, *, anew: bool = False
) -> ChecksReport:
    """Make the clips of an experiment's motion checks in the folder of its clips, and name them in the
    manifest.

    Parameters
    ----------
    anew : bool, optional
        Draw another seed than that of the checks that are there.

    Raises
    ------
    InputError
        The experiment asks for no checks, the folder holds no clips of it or cannot be written, or the work
        was interrupted; what is made by then is kept and used by the next run.
    """
    if not any(motion_checks_by_block(experiment)):
        raise InputError(
            f"'{experiment.name}' has no motion checks; set online_recruitment in [evidence], or per_block "
            "in [evidence.motion_checks]"
        )
    former = former_manifest(experiment, folder)
    if former is None:
        raise InputError(f"{folder} has no {MANIFEST_NAME}; build the clips first with `stimuli build`")
    seed = seed_for(folder, former, options, anew=anew)
    planned = planned_checks(experiment, seed, options)
    state = BuildState.read(folder, former)
    missing = missing_checks(planned, state)
    progress(0, len(missing))
    with readable_failures(folder, state), state.recording():
        keep_seed(folder, seed)
        for done, built in enumerate(rendered_checks(missing, folder), start=1):
            state.add(built)
            progress(done, len(missing))
        manifest = with_checks(former, planned, seed, state)
        write_bytes(folder / MANIFEST_NAME, manifest_text(manifest).encode())
    removed = stale(former, manifest)
    for name in removed:
        (folder / name).unlink(missing_ok=True)
    finish_checks(folder, state)
    return ChecksReport(manifest, len(missing), removed)


# Decision 0601: Checks come from a secret seed in the manifest.
def seed_for(folder: Path, former: Manifest | None, options: Options, *, anew: bool = False) -> int:
    """The seed of the checks: the option's, that of an unfinished or former build, else a secret one."""
    if options.checks_seed is not None:
        return options.checks_seed
    begun = folder / SEED_NAME
    if begun.is_file() and (text := begun.read_text(encoding="utf-8").strip()).isdigit():
        return int(text)
    if former is not None and former.checks_seed is not None and not anew:
        return former.checks_seed
    return secrets.randbits(SEED_BITS)


def keep_seed(folder: Path, seed: int) -> None:
    """Note the seed until the manifest holds it."""
    write_bytes(folder / SEED_NAME, str(seed).encode())


def finish_checks(folder: Path, state: BuildState) -> None:
    """The manifest says everything: what was noted meanwhile goes."""
    (folder / SEED_NAME).unlink(missing_ok=True)
    state.finish()


def missing_checks(planned: Sequence[PlannedCheck], state: BuildState) -> list[PlannedCheck]:
    """The checks whose clip is not there as it was made."""
    return [check for check in planned if not state.intact(check.job.input_hash)]


def rendered_checks(missing: Sequence[PlannedCheck], folder: Path) -> Iterator[Built]:
    """Render clips into `folder`, each whole or not at all, under names that say nothing of them."""
    for check in missing:
        content = check.job.render()
        sha256 = hashlib.sha256(content).hexdigest()
        write_bytes(folder / f"{sha256}.mp4", content)
        yield Built(check.job.input_hash, f"{sha256}.mp4", sha256, len(content), check.job.frames)


def with_checks(
    manifest: Manifest, planned: Sequence[PlannedCheck], seed: int, state: BuildState
) -> Manifest:
    """The manifest with these checks in place of those that it had."""
    checks = tuple(_check_clip(check, state) for check in planned)
    return manifest.model_copy(update={"checks": checks, "checks_seed": seed if checks else None})


def _check_clip(check: PlannedCheck, state: BuildState) -> CheckClip:
    job, built = check.job, state[check.job.input_hash]
    return CheckClip(
        check=job.check,
        number=job.number,
        answer=job.answer,
        file=built.file,
        sha256=built.sha256,
        bytes=built.bytes,
        fps=job.fps,
        frames=built.frames,
        width_px=job.size_px[0],
        height_px=job.size_px[1],
        width_mm=check.width_mm,
        inputs={
            RENDER_KEY: job.input_hash,
            "difficulty": f"{job.difficulty:g}",
            "contrast": f"{job.contrast:g}",
            "encoder": job.encoder,
        },
    )
