"""One clip outside any experiment."""

from dataclasses import dataclass, replace
from pathlib import Path

from experiments.declaration.rendering import PROFILES, RenderSettings
from experiments.errors import InputError, did_you_mean
from experiments.files import whole_file
from stimuli_builder.blinks.library import load_library
from stimuli_builder.clips.characters import geometry
from stimuli_builder.clips.curves import (
    ClipCurve,
    Timing,
    amplitude_of,
    clip_curve,
    samples_per_frame,
    shown_by,
)
from stimuli_builder.clips.design_clips import Options, check_look, look_of
from stimuli_builder.clips.exemplars import Exemplar, exemplar, of_declared_length
from stimuli_builder.clips.jobs import ClipJob, render


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
    job = ClipJob(look_of(settings, Options(barcode=clip.barcode)), curve)
    with whole_file(out) as temporary:
        temporary.write_bytes(render(job))
    return RenderedClip(curve, job.frames, int(curve.onset_sample / samples_per_frame(settings.fps)))


def _blink(clip: SingleClip) -> Exemplar:
    settings = clip.settings
    if clip.profile in PROFILES or clip.profile.endswith(".csv"):
        chosen = settings.model_copy(update={"profile": clip.profile})
        return exemplar(chosen, clip.profile, clip.exemplar, clip.seed)
    shipped = {p.profile_id: p for paired in (False, True) for p in load_library(paired=paired)}
    if clip.profile not in shipped:
        names = [*PROFILES, *shipped]
        raise InputError(f"there is no blink profile '{clip.profile}'{did_you_mean(clip.profile, names)}")
    profile = shipped[clip.profile]
    profile = of_declared_length(profile, settings)
    if settings.eyes == "separate" and profile.closure_other is None:
        raise InputError(
            f"profile {clip.profile} shows one eye; --eyes separate needs a profile of both eyes"
        )
    if settings.eyes == "alike":
        profile = replace(profile, closure_other=None)
    return Exemplar(amplitude_of(profile, settings.amplitude), repeated=False, phase_samples=0)
