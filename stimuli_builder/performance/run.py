"""The command `stimuli performance`: speech in, lid curves out."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple, cast, get_args

import numpy as np
import webvtt
from numpy.typing import NDArray
from rich.console import Console
from webvtt.models import Caption

from blink_engine import Event, Hold, Performance, StateName, default_parameters, perform
from blink_engine.laws import Law
from blink_engine.parameters import Parameters
from blink_engine.performance import GAZE_CLOSURE_MAX, join_holds
from blink_engine.speech import Speech, join_speech, seed_of_speaker, speech_events, speech_states
from experiments.errors import InputError, counted, did_you_mean
from experiments.files import check_targets, whole_text
from stimuli_builder.blinks.export import AnimationCurve, CurveTarget, check_format, write_curve
from table_files.open import named_rows

# Where somebody speaks by the times of subtitles (WebVTT, SubRip).

SUFFIXES = (".vtt", ".srt")


def speech_in_subtitles(path: Path, speaker: str | None = None) -> tuple[list[Speech], float]:
    """Return the stretches of speech, in order whatever the file's, and when the last one ends.

    Parameters
    ----------
    path : Path
        A .vtt or .srt file.
    speaker : str, optional
        Of a file with voices (<v Name>), the one whose eyes these are. One of several voices must be named.

    Raises
    ------
    InputError
        Where the file cannot be read, a time is impossible, nobody of that name speaks, or several people
        speak and none is named.
    """
    captions = _captions(path)
    voices = sorted({caption.voice for caption in captions if caption.voice})
    if speaker is None and len(voices) > 1:
        raise InputError(
            f"{path}: expected one person, got {len(voices)} voices ({', '.join(voices)}); choose one: "
            f"--speaker {shlex.quote(voices[0])}, in an experiment speech = "
            f'"{path.name}#{voices[0]}"'
        )
    if speaker is not None and speaker not in voices:
        spoken = f"; voices: {', '.join(voices)}" if voices else "; the file names no voices"
        raise InputError(f"{path}: there is no speaker '{speaker}'{did_you_mean(speaker, voices)}{spoken}")
    # The length of all voices: the others' last words belong to the dialogue that this person hears.
    length_s = max((_seconds(caption.end) for caption in captions), default=0.0)
    own = [caption for caption in captions if speaker is None or caption.voice == speaker]
    return join_speech([_stretch(path, caption) for caption in own]), length_s


def _captions(path: Path) -> list[Caption]:
    # SubRip differs by its comma before the milliseconds.
    read = webvtt.read if path.suffix.lower() == ".vtt" else webvtt.from_srt
    try:
        captions = list(read(str(path)).captions)
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: expected subtitles in UTF-8 ({error.reason}); save them as UTF-8"
        ) from error
    except (OSError, webvtt.errors.MalformedFileError) as error:
        raise InputError(f"{path}: expected subtitles ({' or '.join(SUFFIXES)}): {error}") from error
    if not captions:
        raise InputError(f"{path}: expected subtitles with times, found none")
    return captions


def _stretch(path: Path, caption: Caption) -> Speech:
    start_s, end_s = _seconds(caption.start), _seconds(caption.end)
    if end_s <= start_s:
        raise InputError(f"{path}: a subtitle ends at {caption.end}, before or at its start {caption.start}")
    return Speech(start_s, end_s)


def _seconds(stamp: str) -> float:
    seconds = 0.0
    # Hours may be missing; each part is 60 times the next.
    for part in stamp.replace(",", ".").split(":"):
        seconds = seconds * 60.0 + float(part)
    return seconds


# Where somebody speaks in a recording, by the voice activity detector of WebRTC.

RATE_HZ = 16_000
FRAME_MS = 30
# WebRTC takes 0 to 3; higher means that less is called speech.
AGGRESSIVENESS = 2
HANGOVER_FRAMES = 4
"""A gap this short within speech does not end it: the detector flickers on soft sounds."""

SPEECH_MIN_S = 0.15
"""Shorter sounds are clicks, or the detector still learning the room."""


def read_audio(path: Path) -> tuple[bytes, float]:
    """Return the first audio stream as 16 kHz mono 16-bit samples, and its length in s.

    Raises
    ------
    InputError
        Where the file cannot be read or holds no sound.
    """
    import av

    try:
        with av.open(str(path)) as container:
            if not container.streams.audio:
                raise InputError(f"{path}: expected a file with sound, but this one has none")
            resampler = av.AudioResampler(format="s16", layout="mono", rate=RATE_HZ)
            frames = [
                part.to_ndarray() for frame in container.decode(audio=0) for part in resampler.resample(frame)
            ]
            # None empties the resampler, which holds back the last samples.
            frames += [part.to_ndarray() for part in resampler.resample(None)]
    except (av.FFmpegError, OSError) as error:
        reason = error.strerror or "it cannot be decoded"  # without the number, which says nothing to people
        raise InputError(
            f"{path}: expected sound that can be read (WAV, MP3, FLAC, ...) or subtitles (.vtt, .srt): "
            f"{reason}"
        ) from error
    samples = np.concatenate([frame.ravel() for frame in frames]) if frames else np.zeros(0, dtype=np.int16)
    if not samples.size:
        raise InputError(f"{path}: expected sound, but the file has no samples")
    # Little-endian, whatever the computer, as the detector expects.
    return samples.astype("<i2").tobytes(), samples.size / RATE_HZ


def speech_in_audio(path: Path) -> tuple[list[Speech], float]:
    """Return the stretches of speech in a recording and its length in s; silence has none."""
    # An extra (`track` or `render`) brings it; subtitles do without.
    import webrtcvad

    samples, duration_s = read_audio(path)
    detector = webrtcvad.Vad(AGGRESSIVENESS)
    # In bytes: two for each sample.
    size = RATE_HZ * FRAME_MS // 1000 * 2
    step_s = FRAME_MS / 1000
    spoken = [
        Speech(start / size * step_s, (start / size + 1) * step_s)
        # A last frame that is not full is left out: the detector takes whole frames only.
        for start in range(0, len(samples) - size + 1, size)
        if detector.is_speech(samples[start : start + size], RATE_HZ)
    ]
    stretches = join_speech(spoken, HANGOVER_FRAMES * step_s)
    # After the gaps are closed: several short sounds in a row are speech.
    return join_speech([one for one in stretches if one.end_s - one.start_s > SPEECH_MIN_S]), duration_s


# The whole performance.

MAX_FRAMES = 6_000_000
"""A day at 60 frames a second; more is a slip of the keyboard, and would fill the memory."""
MAX_SECONDS = 86_400
LOWER_UP_MM, LOWER_IN_MM = 0.75, 2.6
"""The lower lid's full travel: the middle of the ranges of `stimuli_builder.blinks.export`."""


@dataclass(frozen=True)
class PerformanceJob:
    """What `stimuli performance` is asked for; `source` None means no speech, for `duration_s`."""

    out: Path
    source: Path | None = None
    format_name: str = "csv"
    fps: float = 60.0
    seed: int = 1
    state: str = "listening"
    duration_s: float | None = None
    speaker: str | None = None
    rate: float | None = None
    blinks_at: Path | None = None
    complete: float | None = None
    lively: float | None = None
    gaze: Path | None = None
    flag: Path | None = None
    target: CurveTarget = field(default_factory=CurveTarget)


def write_performance(job: PerformanceJob) -> None:
    """Write the lid curves of a whole performance; see `stimuli performance --help`."""
    state = _checked(job)
    stretches, length_s = _speech(job)
    # A duration that is given wins over the length of the source.
    duration_s = job.duration_s or length_s
    if duration_s <= 0:
        raise InputError("expected a recording, subtitles, or --duration in seconds; got none")
    if duration_s * job.fps > MAX_FRAMES:
        raise InputError(
            f"expected at most {MAX_FRAMES} frames, got {duration_s * job.fps:.0f}; lower --duration or --fps"
        )
    onsets = [] if job.blinks_at is None else _onsets(job.blinks_at, duration_s)
    gaze = None if job.gaze is None else read_gaze(job.gaze, duration_s)
    shifts = [] if gaze is None else gaze_shifts(gaze)
    holds = [] if job.flag is None else read_flag(job.flag, duration_s)
    parameters = _parameters(job, state)
    done = perform(
        duration_s,
        job.fps,
        seed=job.seed if job.speaker is None else seed_of_speaker(job.seed, job.speaker),
        state=state,
        # Given onsets are every blink: those of speech and gaze would come on top.
        events=[Event("blink", one) for one in onsets] if onsets else [*speech_events(stretches), *shifts],
        changes=speech_states(stretches, state) if stretches else (),
        holds=holds,
        parameters=parameters,
        # A clip that stops in mid-blink cannot be looped or joined.
        ends_open=True,
    )
    curve = animation_curve(done)
    if gaze is not None:
        curve = looking(curve, gaze, parameters.gaze_closure_per_deg)
    # The text is made before the file is opened, so an error leaves no empty file.
    text = write_curve(job.format_name, curve, job.target)
    with whole_text(job.out) as stream:
        stream.write(text)
    spoken_s = sum(one.end_s - one.start_s for one in stretches)
    heard = f"{spoken_s:.1f} s of speech in {len(stretches)} stretches; " if stretches else ""
    held_s = sum(one.end_s - one.start_s for one in holds)
    if job.flag is not None:
        heard += f"the flag is up for {held_s:.1f} s; "
    Console(markup=False).print(
        f"{heard}{counted(len(done.blinks), 'blink')} in {duration_s:.1f} s, {done.left.size} frames at "
        f"{job.fps:g} fps; wrote {job.out}"
    )
    if job.source is not None and not stretches:
        Console(stderr=True, markup=False).print(
            f"{job.source}: there is no speech; the blinks are those of '{job.state}'"
        )


def _parameters(job: PerformanceJob, state: StateName) -> Parameters:
    """The engine's parameters with what the job changes."""
    parameters = default_parameters()
    if job.rate is not None:
        parameters = parameters.with_rate(state, job.rate)
    if job.lively is not None:
        # Half to twice the published rate in every state: most people's means lie between.
        laws = {
            # 0 doubles the mean interval, 0.5 leaves it, 1 halves it.
            one: law.with_mean(law.mean * 2 ** (1 - 2 * job.lively))
            for one, law in parameters.intervals.items()
        }
        parameters = parameters.with_intervals(laws)
    if job.complete is not None:
        parameters = parameters.with_profile(complete_share=job.complete, long_share=0.0)
    if job.blinks_at is not None:
        # Longer than any performance: nothing but the given blinks.
        never = Law("fixed", 10 * MAX_SECONDS)
        parameters = parameters.with_intervals(dict.fromkeys(parameters.intervals, never))
        parameters = parameters.with_profile(double_share=0.0)
    return parameters


def _onsets(path: Path, duration_s: float) -> list[float]:
    """Times in s at which a file says that blinks begin: its column `time_s` or `onset_s`."""
    table = named_rows(path)
    name = next((one for one in ("time_s", "onset_s") if one in table.header), None)
    if name is None:
        raise InputError(f"{path}: expected a column time_s or onset_s, got {', '.join(table.header)}")
    texts = [row[name] for _, row in table.rows if row[name].strip()]
    try:
        onsets = sorted(float(text) for text in texts)
    except ValueError as error:
        raise InputError(f"{path}: {name}: expected seconds: {error}") from error
    if not onsets or not all(0 <= one <= duration_s for one in onsets):  # NaN is in no range
        raise InputError(f"{path}: expected times from 0 to {duration_s:g} s; fix them or --duration")
    # The engine begins no blink sooner than this after another.
    least = default_parameters().least_interval_s
    for earlier, later in pairwise(onsets):
        if later - earlier < least:
            said = f"expected {least:g} s between blinks, got {earlier:g} and {later:g} s"
            raise InputError(f"{path}: {said}")
    return onsets


# While a flag is up, blinks are held back.

FLAGS = dict.fromkeys(("0", "0.0", "down", "false"), False) | dict.fromkeys(("1", "1.0", "up", "true"), True)


def read_flag(path: Path, duration_s: float) -> list[Hold]:
    """When a flag is up: a CSV with time_s and flag (it keeps its value), or with start_s and end_s.

    Raises
    ------
    InputError
        A column is missing, a value is neither up nor down, or times are impossible.
    """
    table = named_rows(path)
    spans = "start_s" in table.header and "end_s" in table.header
    if not spans and not {"time_s", "flag"} <= set(table.header):
        raise InputError(
            f"{path}: expected the columns time_s and flag, or start_s and end_s, got "
            f"{', '.join(table.header)}"
        )
    rows = [row for _, row in table.rows]
    times = _numbers(path, rows, ("start_s", "end_s") if spans else ("time_s",), "seconds")
    if not rows:
        raise InputError(f"{path}: expected one row or more under the header, got none")
    # NaN is in no range. A track of flags may go on after the end, and a span may begin before the start.
    if not ((times[:, -1] >= 0) & (times[:, 0] <= duration_s)).any():
        raise InputError(f"{path}: expected times from 0 to {duration_s:g} s; correct them or --duration")
    if spans:
        if not (np.isfinite(times).all() and (times[:, 0] < times[:, 1]).all()):
            raise InputError(f"{path}: expected each end_s after its start_s")
        starts, ends = times.T
    else:
        if not (np.isfinite(times).all() and (np.diff(times[:, 0]) > 0).all()):
            raise InputError(f"{path}: expected rising times in every row")
        texts = [row["flag"].strip().lower() for row in rows]
        unknown = next((text for text in texts if text not in FLAGS), None)
        if unknown is not None:
            raise InputError(f"{path}: flag: expected 0 (down) or 1 (up), got '{unknown}'")
        up = np.array([FLAGS[text] for text in texts])
        # The last value holds until the end.
        starts, ends = times[up, 0], np.append(times[1:, 0], max(duration_s, times[-1, 0] + 1))[up]
    return join_holds(
        Hold(max(0.0, float(start)), min(duration_s, float(end)))
        for start, end in zip(starts, ends, strict=True)
        if start < duration_s and end > 0
    )


def _numbers(
    path: Path, rows: Sequence[Mapping[str, str]], names: Sequence[str], what: str
) -> NDArray[np.float64]:
    """Columns of a table (rows, names)."""
    try:
        return np.array([[float(row[name]) for name in names] for row in rows])
    except ValueError as error:
        raise InputError(f"{path}: expected {what}: {error}") from error


# Where the eyes look: lids follow the gaze, and blinks come with large shifts of it.

GAZE_DEG_MAX = 60.0
SHIFT_DEG_PER_S = 80.0
"""Eyes that turn faster make a saccade; pursuit of what moves is slower."""
SHIFT_DEG_MIN = 3.0
"""Smaller saccades bring no blink (Evinger and others 1994), and look like noise."""
GAZE_HZ = 200


class GazeTrack(NamedTuple):
    """Direction of gaze at `time_s` (n,): `deg` (n, 2) to the person's right and up, in degrees."""

    time_s: NDArray[np.float64]
    deg: NDArray[np.float64]


def read_gaze(path: Path, duration_s: float) -> GazeTrack:
    """Read a CSV with time_s and right_deg, up_deg or both.

    Raises
    ------
    InputError
        A column is missing, a value is not a number, times do not rise, or nobody can look that far.
    """
    table = named_rows(path)
    given = [name for name in ("right_deg", "up_deg") if name in table.header]
    if "time_s" not in table.header or not given:
        raise InputError(
            f"{path}: expected the columns time_s, right_deg and up_deg, got {', '.join(table.header)}"
        )
    values = _numbers(path, [row for _, row in table.rows], ("time_s", *given), "numbers")
    # Finite before rising: a comparison with NaN is false, too.
    if not len(values) or not np.isfinite(values).all() or not (np.diff(values[:, 0]) > 0).all():
        raise InputError(f"{path}: expected rising times and finite angles in every row")
    if values[0, 0] > duration_s or values[-1, 0] < 0:
        raise InputError(f"{path}: expected times from 0 to {duration_s:g} s; correct them or --duration")
    if np.abs(values[:, 1:]).max() > GAZE_DEG_MAX:
        raise InputError(f"{path}: expected angles up to {GAZE_DEG_MAX:g} degrees; eyes turn no further")
    # A direction that is not given is 0, straight ahead.
    deg = np.zeros((len(values), 2))
    for column, name in enumerate(("right_deg", "up_deg")):
        if name in given:
            deg[:, column] = values[:, 1 + given.index(name)]
    return GazeTrack(values[:, 0], deg)


def gaze_shifts(gaze: GazeTrack) -> list[Event]:
    """The saccades of a track: where they begin, and how far each leads."""
    at = np.arange(gaze.time_s[0], gaze.time_s[-1] + 1 / GAZE_HZ, 1 / GAZE_HZ)
    # Averaged over 20 ms: from sample to sample the noise of an eye tracker is as fast as a saccade.
    window = np.full(GAZE_HZ // 50, 50 / GAZE_HZ)
    raw = [np.interp(at, gaze.time_s, column) for column in gaze.deg.T]
    padded = [np.pad(one, (window.size // 2, window.size - 1 - window.size // 2), mode="edge") for one in raw]
    deg = np.stack([np.convolve(one, window, mode="valid") for one in padded], axis=1)
    fast = np.r_[False, np.hypot(*np.diff(deg, axis=0).T) * GAZE_HZ > SHIFT_DEG_PER_S, False]
    begins, ends = (np.flatnonzero(fast[1:] & ~fast[:-1]), np.flatnonzero(~fast[1:] & fast[:-1]))
    ways = np.hypot(*(deg[ends] - deg[begins]).T)
    return [
        Event("gaze_shift", float(at[begin]), float(way))
        for begin, way in zip(begins, ways, strict=True)
        if at[begin] >= 0 and way >= SHIFT_DEG_MIN
    ]


def looking(curve: AnimationCurve, gaze: GazeTrack, closure_per_deg: float) -> AnimationCurve:
    """The curve with the gaze at each frame and lids that follow it.

    Eyes that look up would open wider than a shape of a blink can show: the lids then stay.
    """
    at = np.arange(curve.left.size) / curve.fps
    deg = np.stack([np.interp(at, gaze.time_s, column) for column in gaze.deg.T], axis=1)
    # Lids follow the gaze down only.
    covered = np.clip(-closure_per_deg * deg[:, 1], 0.0, GAZE_CLOSURE_MAX)
    # What the gaze has covered is not there for the blink to close.
    left, right = (np.round(covered + (1 - covered) * lid, 6) for lid in (curve.left, curve.right))
    return replace(curve, left=left, right=right, gaze_deg=np.round(deg, 4))


def animation_curve(done: Performance) -> AnimationCurve:
    """Return a performance as the curve that the exports write, the lower lid in mm."""
    return AnimationCurve(
        done.fps,
        np.round(done.left, 6),
        np.round(done.right, 6),
        np.round(LOWER_UP_MM * (done.left_lower_up + done.right_lower_up) / 2, 6),
        np.round(LOWER_IN_MM * (done.left_lower_in + done.right_lower_in) / 2, 6),
        tuple((blink.cause, round(blink.onset_s * done.fps, 4)) for blink in done.blinks),
    )


def _checked(job: PerformanceJob) -> StateName:
    check_format(job.format_name, job.target)
    if not 1 <= job.fps <= 1000:
        raise InputError(f"expected --fps from 1 to 1000, got {job.fps:g}")
    if job.rate is not None and not 0.1 <= job.rate <= 60:
        raise InputError(f"expected --rate from 0.1 to 60 blinks a minute, got {job.rate:g}")
    if job.duration_s is not None and not 0 < job.duration_s <= MAX_SECONDS:
        raise InputError(f"expected --duration from 0 to {MAX_SECONDS} seconds, got {job.duration_s:g}")
    for option, share in (("--complete", job.complete), ("--lively", job.lively)):
        if share is not None and not 0 <= share <= 1:
            raise InputError(f"expected {option} from 0 to 1, got {share:g}")
    # Both change intervals, which given blinks do not have.
    if job.blinks_at is not None and (job.rate is not None or job.lively is not None):
        raise InputError("--blinks-at gives every blink; remove --rate and --lively")
    if job.gaze is not None and job.blinks_at is not None:
        raise InputError("--blinks-at gives every blink, and --gaze brings others; remove one of them")
    if job.flag is not None and job.blinks_at is not None:
        raise InputError("--blinks-at gives every blink; remove --blink-while-down")
    if job.state not in get_args(StateName):
        states = list(get_args(StateName))
        raise InputError(f"unknown --state '{job.state}'{did_you_mean(job.state, states)}")
    check_targets([job.out], [job.source])
    return cast(StateName, job.state)


def _speech(job: PerformanceJob) -> tuple[list[Speech], float]:
    return ([], 0.0) if job.source is None else speech_of(job.source, job.speaker)


def speech_of(source: Path, speaker: str | None = None) -> tuple[list[Speech], float]:
    """Return the stretches of speech of a recording or of subtitles, and its length in s."""
    if not source.is_file():
        raise InputError(f"{source}: no such file; expected a recording with sound, or subtitles")
    if source.suffix.lower() in SUFFIXES:
        return speech_in_subtitles(source, speaker)
    if speaker is not None:
        raise InputError("--speaker is only for subtitles with voices; a recording has no names")
    return speech_in_audio(source)
