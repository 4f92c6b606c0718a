"""Which check clips a study declares: kinds in turn, everything else drawn from the seed."""

from dataclasses import dataclass

from experiments import design
from experiments.assignment.checks import motion_checks_by_block
from experiments.checks import CHECK_KINDS, CheckName
from experiments.definition import Experiment
from experiments.rendering import RenderSettings
from stimuli_builder.checks.jobs import CheckJob
from stimuli_builder.clips.characters import geometry
from stimuli_builder.clips.design_clips import Options, look_of
from stimuli_builder.clips.seeds import generator


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
    settings = _settings(experiment, seed, number)
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
    scale = geometry(settings.character, options.beside).px_per_mm_at(settings.width_px)
    return PlannedCheck(job, round(job.size_px[0] / scale, 4))


def _settings(experiment: Experiment, seed: int, number: int) -> RenderSettings:
    """How a cell drawn by the seed is rendered: its character, size and rate are the check's."""
    clips = design.clips(experiment)
    drawn = generator("check", seed, number, "cell").integers(len(clips))
    return design.render_settings(experiment, clips[int(drawn)])


def bt709(colour: str) -> tuple[int, int, int]:
    """`#rrggbb` as limited-range BT.709 Y, Cb, Cr, 8 bits each (ITU-R BT.709-6, items 3.2 to 3.5)."""
    red, green, blue = (int(colour[digit : digit + 2], 16) / 255 for digit in (1, 3, 5))
    luma = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    return (
        round(16 + 219 * luma),
        round(128 + 224 * (blue - luma) / 1.8556),
        round(128 + 224 * (red - luma) / 1.5748),
    )
