"""Where somebody speaks in a recording, by the voice activity detector of WebRTC."""

from pathlib import Path

import av
import numpy as np
import webrtcvad

from blink_engine.speech import Speech, join_speech
from experiments.errors import InputError

RATE_HZ = 16_000
FRAME_MS = 30
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
    try:
        with av.open(str(path)) as container:
            if not container.streams.audio:
                raise InputError(f"{path}: expected a file with sound, but this one has none")
            resampler = av.AudioResampler(format="s16", layout="mono", rate=RATE_HZ)
            frames = [
                part.to_ndarray() for frame in container.decode(audio=0) for part in resampler.resample(frame)
            ]
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
    return samples.astype("<i2").tobytes(), samples.size / RATE_HZ


def speech_in_audio(path: Path) -> tuple[list[Speech], float]:
    """Return the stretches of speech in a recording and its length in s; silence has none."""
    samples, duration_s = read_audio(path)
    detector = webrtcvad.Vad(AGGRESSIVENESS)
    size = RATE_HZ * FRAME_MS // 1000 * 2
    step_s = FRAME_MS / 1000
    spoken = [
        Speech(start / size * step_s, (start / size + 1) * step_s)
        for start in range(0, len(samples) - size + 1, size)
        if detector.is_speech(samples[start : start + size], RATE_HZ)
    ]
    stretches = join_speech(spoken, HANGOVER_FRAMES * step_s)
    return join_speech([one for one in stretches if one.end_s - one.start_s > SPEECH_MIN_S]), duration_s
