"""A clip of living eyes: the blink engine's lids over many seconds, as a curve at 300 fps."""

from pathlib import Path

import numpy as np

from blink_engine import Event, Law, Parameters, Performance, StateChange, default_parameters, perform
from blink_engine.speech import Speech, seed_of_speaker, speech_events, speech_states
from experiments.errors import InputError
from experiments.rendering import RenderSettings
from stimuli_builder.blinks.profile import PROFILE_FPS
from stimuli_builder.clips.curves import DECIMALS, Array, ClipCurve
from stimuli_builder.clips.seeds import generator
from stimuli_builder.performance.run import LOWER_IN_MM, LOWER_UP_MM, speech_of

TIMER_SHARES = (0.5, 1.5)
"""Shortest and longest interval of a uniform timer as shares of the mean: 2 to 6 s at 15 a minute."""
NEVER_S = 1e9
"""An interval longer than any clip."""


def performance_curve(
    settings: RenderSettings, family: str, number: int, seed: int, beside: Path | None = None
) -> ClipCurve:
    """Return performance `number` (from 1) of a family of exemplars, as `settings` time it.

    Blink k of a performance has the same shape whatever the timing: shapes and times come from streams of
    random numbers of their own. With `amplitude` full every blink closes the eyes fully; with natural as
    many do as the engine was fitted to, and the others as far as it draws.

    Parameters
    ----------
    beside : Path, optional
        Folder that the file `speech` is relative to.

    Raises
    ------
    InputError
        The speech cannot be read, or lasts less than the clip.
    """
    rng = generator("performance", seed, family, number)
    shown = _performed(settings, int(rng.integers(2**31)), rng, beside)
    blinks = tuple(round(blink.onset_s, 4) for blink in shown.blinks)
    closure, other = _rounded(shown.left), _rounded(shown.right)
    vertical, horizontal = _lower_lid(shown, settings.lower_lid)
    return ClipCurve(
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
        events += speech_events(stretches)
        changes = speech_states(stretches, settings.state) if stretches else []
    elif settings.performance != "intervals":
        mean_s = parameters.mean_interval_s(settings.state)
        parameters = _without_spontaneous(parameters)
        if settings.performance == "uniform":
            events = [Event("blink", time_s) for time_s in _timer(settings.seconds, mean_s, rng)]
    return perform(
        settings.seconds,
        PROFILE_FPS,
        seed=seed_of_speaker(seed, speaker) if speaker else seed,
        state=settings.state,
        events=events,
        changes=changes,
        parameters=parameters,
        ends_open=True,
    )


def _parameters(settings: RenderSettings) -> Parameters:
    chosen = default_parameters()
    if settings.amplitude == "full":
        chosen = chosen.with_profile(complete_share=1.0, long_share=0.0)
    if settings.blinks_per_minute is not None:
        chosen = chosen.with_rate(settings.state, settings.blinks_per_minute)
    return chosen


def _without_spontaneous(parameters: Parameters) -> Parameters:
    never = {state: Law("fixed", NEVER_S) for state in parameters.intervals}
    return parameters.with_intervals(never)


def _timer(length_s: float, mean_s: float, rng: np.random.Generator) -> list[float]:
    """Blinks of a timer that runs already when the clip begins: in a long wait rather than a short one."""
    shortest, longest = (share * mean_s for share in TIMER_SHARES)
    times: list[float] = []
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
            f"{settings.speech} lasts {length_s:.1f} s, the clip {settings.seconds:g} s; shorten `seconds`"
        )
    return stretches


def _lower_lid(shown: Performance, lower: str) -> tuple[Array | None, Array | None]:
    """Lift and slide in mm, the mean of the eyes; None where the lower lid is left to the character."""
    if lower == "none":
        return None, None
    vertical = np.round(LOWER_UP_MM * (shown.left_lower_up + shown.right_lower_up) / 2, DECIMALS)
    horizontal = np.round(LOWER_IN_MM * (shown.left_lower_in + shown.right_lower_in) / 2, DECIMALS)
    still = np.zeros(len(vertical))
    return (
        vertical if lower in ("both", "vertical") else still,
        horizontal if lower in ("both", "horizontal") else still,
    )
