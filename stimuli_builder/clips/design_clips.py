"""Every clip of an experiment before anything is rendered: its cell, its blink, its job."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from blink_engine import Event, Law, Parameters, Performance, StateChange, default_parameters, perform
from blink_engine.speech import Speech, seed_of_speaker, speech_events, speech_states
from experiments import design
from experiments.declaration.experiment import Experiment
from experiments.declaration.factors import Level
from experiments.declaration.rendering import PROFILES, RenderSettings
from experiments.declaration.trial import ClipSpec
from experiments.errors import InputError, did_you_mean
from experiments.files import whole_file
from stimuli_builder.blinks.library import load_library
from stimuli_builder.blinks.profile import PROFILE_FPS
from stimuli_builder.clips.characters import DRAWN, fingerprint, geometry
from stimuli_builder.clips.curves import (
    DECIMALS,
    Array,
    ClipCurve,
    Timing,
    amplitude_of,
    clip_curve,
    generator,
    samples_per_frame,
    shown_by,
)
from stimuli_builder.clips.exemplars import Exemplar, exemplar, number_of_blinks, of_declared_length
from stimuli_builder.clips.geometry import Geometry, Movement
from stimuli_builder.clips.jobs import ClipJob, Look, render
from stimuli_builder.clips.life import draw_life, following_lids
from stimuli_builder.performance.run import LOWER_IN_MM, LOWER_UP_MM, speech_of

# A clip of living eyes: the blink engine's lids over many seconds, as a curve at 300 fps.

TIMER_SHARES = (0.5, 1.5)
"""Shortest and longest interval of a uniform timer as shares of the mean: 2 to 6 s at 15 a minute."""
NEVER_S = 1e9
"""An interval longer than any clip."""


def performance_curve(
    settings: RenderSettings, family: str, number: int, seed: int, beside: Path | None = None
) -> ClipCurve:
    """Return performance `number` (from 1) of a family of exemplars, as `settings` time it.

    Blink k of a performance has the same shape whatever the timing: shapes and times come from separate
    streams of random numbers. With `amplitude` full every blink closes the eyes fully; with natural as many
    do as the engine was fitted to, and the others as far as it draws.

    Parameters
    ----------
    beside : Path, optional
        Folder that the file `speech` is relative to.

    Raises
    ------
    InputError
        The speech cannot be read, or lasts less than the clip.
    """
    # The seed of the blinks is drawn first, so that it is the same with every timing.
    rng = generator("performance", seed, family, number)
    shown = _performed(settings, int(rng.integers(2**31)), rng, beside)
    # 0.1 ms: far below a sample, and short in the manifest.
    blinks = tuple(round(blink.onset_s, 4) for blink in shown.blinks)
    closure, other = _rounded(shown.left), _rounded(shown.right)
    vertical, horizontal = _lower_lid(shown, settings.lower_lid)
    return ClipCurve(
        # Eyes alike: the left curve is shown by both.
        closure=closure,
        closure_other=other if settings.eyes == "separate" else None,
        onset_sample=int(blinks[0] * PROFILE_FPS) if blinks else 0,
        profile_id=f"performance-{settings.performance}-{number:03d}",
        lower_vertical_mm=vertical,
        lower_horizontal_mm=horizontal,
        blinks_s=blinks,
    )


def _rounded(eye: Array) -> Array:
    return np.asarray(np.round(np.clip(eye, 0.0, 1.0), DECIMALS), np.float64)


def _performed(
    settings: RenderSettings, seed: int, rng: np.random.Generator, beside: Path | None
) -> Performance:
    events: list[Event] = []
    changes: list[StateChange] = []
    parameters = _parameters(settings)
    _, speaker = file_and_speaker(settings.speech)
    if settings.performance == "events":
        events = [Event(settings.event, time_s) for time_s in settings.events_s]
        stretches = _speech(settings, beside)
        # Blinks at declared times and those that come with speech add up.
        events += speech_events(stretches)
        changes = speech_states(stretches, settings.state) if stretches else []
    elif settings.performance != "intervals":
        # Read before the intervals are replaced: the timer takes its mean from them.
        mean_s = parameters.mean_interval_s(settings.state)
        parameters = _without_spontaneous(parameters)
        if settings.performance == "uniform":
            events = [Event("blink", time_s) for time_s in _timer(settings.seconds, mean_s, rng)]
    return perform(
        settings.seconds,
        PROFILE_FPS,
        # Two speakers of one dialogue would otherwise blink at the same moments.
        seed=seed_of_speaker(seed, speaker) if speaker else seed,
        state=settings.state,
        events=events,
        changes=changes,
        parameters=parameters,
        ends_open=True,
    )


def _parameters(settings: RenderSettings) -> Parameters:
    chosen = default_parameters()
    # Long closures are complete, too, but keep the eyes shut for longer than a blink.
    if settings.amplitude == "full":
        chosen = chosen.with_profile(complete_share=1.0, long_share=0.0)
    if settings.blinks_per_minute is not None:
        chosen = chosen.with_rate(settings.state, settings.blinks_per_minute)
    return chosen


def _without_spontaneous(parameters: Parameters) -> Parameters:
    # A Law cannot be infinite; an interval longer than any clip has the same effect.
    never = {state: Law("fixed", NEVER_S) for state in parameters.intervals}
    return parameters.with_intervals(never)


def _timer(length_s: float, mean_s: float, rng: np.random.Generator) -> list[float]:
    """Blinks of a timer already running when the clip begins; long waits are more likely to be under way."""
    shortest, longest = (share * mean_s for share in TIMER_SHARES)
    times: list[float] = []
    # An interval is met in proportion to its length: its density is 2 t / (longest^2 - shortest^2).
    under_way = float(np.sqrt(rng.uniform(shortest**2, longest**2)))
    time_s = float(rng.uniform(0.0, under_way))
    while time_s < length_s:
        times.append(time_s)
        time_s += float(rng.uniform(shortest, longest))
    return times


def file_and_speaker(speech: str) -> tuple[str, str]:
    """The file of a key `speech`, and the voice after its #; empty where none is named.

    >>> file_and_speaker("dialogue.vtt#Anna"), file_and_speaker("speech.wav")
    (('dialogue.vtt', 'Anna'), ('speech.wav', ''))
    """
    file, _, speaker = speech.partition("#")
    return file, speaker


def _speech(settings: RenderSettings, beside: Path | None) -> list[Speech]:
    if not settings.speech:
        return []
    file, speaker = file_and_speaker(settings.speech)
    stretches, length_s = speech_of((beside or Path()) / file, speaker or None)
    if length_s < settings.seconds:
        raise InputError(
            f"{settings.speech} lasts {length_s:.1f} s, but the clip lasts {settings.seconds:g} s; reduce "
            "`seconds`"
        )
    return stretches


def _lower_lid(shown: Performance, lower: str) -> tuple[Array | None, Array | None]:
    """Lift and slide in mm, the mean of the eyes; None where the lower lid is left to the character."""
    if lower == "none":
        return None, None
    vertical = np.round(LOWER_UP_MM * (shown.left_lower_up + shown.right_lower_up) / 2, DECIMALS)
    horizontal = np.round(LOWER_IN_MM * (shown.left_lower_in + shown.right_lower_in) / 2, DECIMALS)
    # A curve has both motions or none: the one that is switched off stays at 0.
    still = np.zeros(len(vertical))
    return (
        vertical if lower in ("both", "vertical") else still,
        horizontal if lower in ("both", "horizontal") else still,
    )


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
    """What a build may choose in addition to the declaration: see `stimuli build --help`."""

    seed: int | None = None
    checks_seed: int | None = None
    barcode: bool = False
    base_folder: Path | None = None

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
    # First, as it renders nothing and names the mistake in the declaration.
    check_levels(experiment)
    return list(_planned(experiment, options))


def check_levels(experiment: Experiment) -> None:
    """InputError where two levels of a factor render alike: their clips would be the same blinks."""
    for factor in experiment.factors:
        # Every level of such a factor has other blinks, so that equal rendering still gives other clips.
        if factor.name in experiment.exemplars.own_per:
            continue
        for number, level in enumerate(factor.levels):
            for other in factor.levels[:number]:
                if _renders_alike(experiment.render, other, level):
                    raise InputError(
                        f"factor '{factor.name}': '{other.name}' and '{level.name}' do not change the "
                        "rendering, so their clips would be the same. Add `render` to them, or write the "
                        "manifest of your own clips with `stimuli manifest`"
                    )


def _renders_alike(declared: RenderSettings, one: Level, other: Level) -> bool:
    if one.render == other.render:
        return True
    # A performance uses neither, so levels that differ in them alone show the same.
    without = {"anticipation": 0.0, "settle": 0.0}
    shown = [level.render.applied_to(declared).model_copy(update=without) for level in (one, other)]
    return shown[0].performance is not None and shown[0] == shown[1]


def _planned(experiment: Experiment, options: Options) -> Iterator[PlannedClip]:
    for spec in design.clips(experiment):
        try:
            yield _plan(experiment, spec, options)
        except InputError as error:
            # A fault of a character or profile does not know for which cell it was wanted.
            raise InputError(f"cell {spec.cell}, exemplar {spec.exemplar}: {error}") from error


def _plan(experiment: Experiment, spec: ClipSpec, options: Options) -> PlannedClip:
    settings = design.render_settings(experiment, spec)
    seed = options.seed_for(experiment)
    character = geometry(settings.character, options.base_folder)
    check_look(settings, character)
    family = exemplar_family(design.exemplar_key(experiment, spec))
    if settings.performance is not None:
        curve, repeated = performance_curve(settings, family, spec.exemplar, seed, options.base_folder), False
    else:
        shown = exemplar(settings, family, spec.exemplar, seed, options.base_folder)
        # Drawn by cell: the phase of a blink within a frame is the same at every rebuild.
        timing = Timing.drawn(settings.fps, shown.phase_samples, seed, spec.cell, spec.exemplar)
        curve, repeated = clip_curve(shown.profile, timing, settings.lower_lid), shown.repeated
    curve, held = shown_by(curve, settings, character.lower_range_mm)
    # The same motion at every level of other factors, as the blink itself is the same.
    life_seed = int(generator("life", seed, family, spec.exemplar).integers(2**31))
    curve = with_life(curve, settings.life, life_seed, character)
    job = ClipJob(look_of(settings, options), curve, life_seed if settings.life else 0)
    return PlannedClip(spec, settings, job, repeated, character, held)


def exemplar_family(key: str) -> str:
    """An exemplar key without its number: what all exemplars of a cell have in common."""
    # Keys end in a slash and the number of the exemplar.
    return key.rpartition("/")[0]


def check_look(settings: RenderSettings, character: Geometry) -> None:
    """Refuse a character that cannot do what a cell asks, or cannot be shown at its size."""
    if settings.lower_lid != "none" and character.lower_range_mm is None:
        raise InputError(
            f"character '{settings.character}' has no lower-lid layer; use lower_lid = 'none' or a "
            "character baked with one"
        )
    # Refused, not ignored: the clip would be labeled with a gaze that it does not show.
    if settings.gaze_mm and settings.character in DRAWN:
        raise InputError(
            f"character '{settings.character}' is drawn with eyes that look straight ahead; remove gaze_mm, "
            "set it to 0, or use a baked face"
        )
    # Only for its errors: a size that the character cannot be shown at.
    character.scaled(settings.width_px, settings.height_px)


def look_of(settings: RenderSettings, options: Options) -> Look:
    """How clips with these settings are rendered."""
    return Look(
        character=settings.character,
        fingerprint=fingerprint(settings.character, options.base_folder),
        encoder=_encoder(),
        size_px=(settings.width_px, settings.height_px),
        fps=settings.fps,
        motion_blur=settings.motion_blur,
        barcode=options.barcode,
        beside=options.base_folder,
        movement=Movement.of_settings(settings),
        life=settings.life,
    )


def with_life(curve: ClipCurve, strength: float, seed: int, character: Geometry) -> ClipCurve:
    """The curve of a clip with motion between blinks: its lids follow the gaze."""
    if not strength:
        return curve
    life = draw_life(len(curve.closure), strength, seed)
    other = curve.closure_other
    return replace(
        curve,
        closure=following_lids(curve.closure, life, character.opening_mm),
        closure_other=None if other is None else following_lids(other, life, character.opening_mm),
    )


# Asked once for all clips of a build; the import loads the video library.
@lru_cache(maxsize=1)
def _encoder() -> str:
    from stimuli_builder.clips.encode import encoder_signature

    return encoder_signature()


# One clip outside any experiment.


@dataclass(frozen=True)
class SingleClip:
    """What `stimuli clip` was asked for; `profile` may also be the name of a shipped recording."""

    settings: RenderSettings
    profile: str
    exemplar: int = 1
    seed: int = 2011
    clip_frames: int | None = None
    barcode: bool = False


@dataclass(frozen=True)
class RenderedClip:
    """A clip that was written."""

    curve: ClipCurve
    frames: int
    onset_frame: int


def render_single(clip: SingleClip, out: Path) -> RenderedClip:
    """Render one clip into `out`, whole or not at all."""
    settings = clip.settings
    character = geometry(settings.character)
    check_look(settings, character)
    shown = _blink(clip)
    timing = Timing.drawn(settings.fps, shown.phase_samples, clip.seed, clip.profile, clip.exemplar)
    curve = clip_curve(shown.profile, timing, settings.lower_lid, clip.clip_frames)
    curve, _ = shown_by(curve, settings, character.lower_range_mm)
    life_seed = int(generator("life", clip.seed, clip.profile, clip.exemplar).integers(2**31))
    curve = with_life(curve, settings.life, life_seed, character)
    job = ClipJob(look_of(settings, Options(barcode=clip.barcode)), curve, life_seed)
    # An interrupted rendering leaves no half clip under the wanted name.
    with whole_file(out) as temporary:
        temporary.write_bytes(render(job))
    return RenderedClip(curve, job.frames, int(curve.onset_sample / samples_per_frame(settings.fps)))


def _blink(clip: SingleClip) -> Exemplar:
    settings = clip.settings
    if clip.profile in PROFILES or clip.profile.endswith(".csv"):
        chosen = settings.model_copy(update={"profile": clip.profile})
        _require_exemplar(clip, number_of_blinks(chosen))
        return exemplar(chosen, clip.profile, clip.exemplar, clip.seed)
    shipped = {p.profile_id: p for paired in (False, True) for p in load_library(paired=paired)}
    if clip.profile not in shipped:
        names = [*PROFILES, *shipped]
        raise InputError(f"there is no blink profile '{clip.profile}'{did_you_mean(clip.profile, names)}")
    _require_exemplar(clip, 1)
    profile = of_declared_length(shipped[clip.profile], settings)
    if settings.eyes == "separate" and profile.closure_other is None:
        raise InputError(
            f"profile {clip.profile} shows one eye; --eyes separate needs a profile of both eyes"
        )
    # The second curve would otherwise move the other eye in spite of --eyes alike.
    if settings.eyes == "alike":
        profile = replace(profile, closure_other=None)
    return Exemplar(amplitude_of(profile, settings.amplitude), repeated=False, phase_samples=0)


def _require_exemplar(clip: SingleClip, count: int | None) -> None:
    # In a study a recording may show up twice, and `stimuli plan` lists it. Here a number means one blink.
    if count is not None and clip.exemplar > count:
        numbers = f"1 to {count}, the blinks of" if count > 1 else "1, the only blink of"
        raise InputError(
            f"--exemplar: expected {numbers} profile '{clip.profile}', got {clip.exemplar}; --profile model "
            "draws a new blink for every number"
        )
