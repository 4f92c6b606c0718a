"""Every clip of an experiment before anything is rendered: its cell, its blink, its job."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from experiments import design
from experiments.definition import Experiment
from experiments.design import ClipSpec
from experiments.errors import InputError
from experiments.rendering import RenderSettings
from stimuli_builder.clips.characters import DRAWN, Geometry, fingerprint, geometry
from stimuli_builder.clips.curves import Timing, clip_curve, shown_by
from stimuli_builder.clips.exemplars import exemplar
from stimuli_builder.clips.face_movement.amounts import Movement
from stimuli_builder.clips.jobs import ClipJob, Look
from stimuli_builder.clips.performances import performance_curve


@dataclass(frozen=True)
class PlannedClip:
    """A clip of the design with everything that decides it."""

    spec: ClipSpec
    settings: RenderSettings
    job: ClipJob
    repeated: bool
    geometry: Geometry
    lower_held: dict[str, str]


@dataclass(frozen=True)
class Options:
    """What a build may choose beside the declaration: see `stimuli build --help`."""

    seed: int | None = None
    checks_seed: int | None = None
    barcode: bool = False
    beside: Path | None = None

    def seed_for(self, experiment: Experiment) -> int:
        """The seed in use: the option's, else the declared one."""
        return experiment.exemplars.seed if self.seed is None else self.seed


def planned_clips(experiment: Experiment, options: Options) -> list[PlannedClip]:
    """All clips of the experiment in design order.

    Raises
    ------
    InputError
        A cell asks for something its character or profile cannot give; the line names the cell. Or two
        levels would give the same clips.
    """
    check_levels(experiment)
    return list(_planned(experiment, options))


def check_levels(experiment: Experiment) -> None:
    """InputError where two levels of a factor render alike: their clips would be the same blinks."""
    for factor in experiment.factors:
        if factor.name in experiment.exemplars.own_per:
            continue
        for number, level in enumerate(factor.levels):
            for other in factor.levels[:number]:
                if other.render == level.render:
                    raise InputError(
                        f"factor '{factor.name}': '{other.name}' and '{level.name}' change nothing "
                        "of the rendering, so their clips would be the same; give them `render`, or write "
                        "the manifest of clips of your own with `stimuli manifest`"
                    )


def _planned(experiment: Experiment, options: Options) -> Iterator[PlannedClip]:
    for spec in design.clips(experiment):
        try:
            yield _plan(experiment, spec, options)
        except InputError as error:
            raise InputError(f"cell {spec.cell}, exemplar {spec.exemplar}: {error}") from error


def _plan(experiment: Experiment, spec: ClipSpec, options: Options) -> PlannedClip:
    settings = design.render_settings(experiment, spec)
    seed = options.seed_for(experiment)
    character = geometry(settings.character, options.beside)
    check_look(settings, character)
    family = exemplar_family(design.exemplar_key(experiment, spec))
    if settings.performance is not None:
        curve, repeated = performance_curve(settings, family, spec.exemplar, seed, options.beside), False
    else:
        shown = exemplar(settings, family, spec.exemplar, seed, options.beside)
        timing = Timing.drawn(settings.fps, shown.phase_samples, seed, spec.cell, spec.exemplar)
        curve, repeated = clip_curve(shown.profile, timing, settings.lower_lid), shown.repeated
    curve, held = shown_by(curve, settings, character.lower_range_mm)
    job = ClipJob(look_of(settings, options), curve)
    return PlannedClip(spec, settings, job, repeated, character, held)


def exemplar_family(key: str) -> str:
    """An exemplar key without its number: what all exemplars of a cell have in common."""
    return key.rpartition("/")[0]


def check_look(settings: RenderSettings, character: Geometry) -> None:
    """Refuse a character that cannot do what a cell asks, or cannot be shown at its size."""
    if settings.lower_lid != "none" and character.lower_range_mm is None:
        raise InputError(
            f"character '{settings.character}' has no lower-lid layer; use lower_lid = 'none' or a "
            "character baked with one"
        )
    if settings.gaze_mm and settings.character in DRAWN:
        raise InputError(
            f"character '{settings.character}' is drawn with eyes that look straight on; leave gaze_mm out, "
            "set it to 0, or use a baked face"
        )
    character.scaled(settings.width_px, settings.height_px)


def look_of(settings: RenderSettings, options: Options) -> Look:
    """How clips with these settings are rendered."""
    return Look(
        character=settings.character,
        fingerprint=fingerprint(settings.character, options.beside),
        encoder=_encoder(),
        size_px=(settings.width_px, settings.height_px),
        fps=settings.fps,
        motion_blur=settings.motion_blur,
        barcode=options.barcode,
        beside=options.beside,
        movement=Movement.of_settings(settings),
    )


@lru_cache(maxsize=1)
def _encoder() -> str:
    from stimuli_builder.clips.encode import encoder_signature

    return encoder_signature()
