"""Where somebody speaks in a sound, by its loudness: Blender carries no detector of speech."""

import numpy as np
import numpy.typing as npt

from blink_engine.speech import Speech, join_speech

FRAME_S = 0.03
SPEECH_MIN_S = 0.15
HANGOVER_S = 0.12
ABOVE_NOISE_DB = 12.0
BELOW_LOUD_DB = 30.0
SILENCE_DB = -60.0


def speech_in_samples(samples: npt.NDArray[np.float32], rate_hz: float) -> list[Speech]:
    """Stretches of speech in mono samples (n,) between -1 and 1; none in silence or steady noise.

    A frame of 30 ms counts as speech where it is 12 dB above the noise (the level that a tenth of the frames
    stays under) and at most 30 dB below the loudest twentieth.
    """
    size = int(FRAME_S * rate_hz)
    frames = samples[: samples.size // size * size].reshape(-1, size).astype(np.float64)
    if not len(frames):
        return []
    level_db = 10 * np.log10(np.maximum((frames**2).mean(axis=1), 1e-12))
    noise, loud = np.percentile(level_db, [10, 95])
    threshold = max(noise + ABOVE_NOISE_DB, loud - BELOW_LOUD_DB, SILENCE_DB)
    spoken = [Speech(n * FRAME_S, (n + 1) * FRAME_S) for n in np.flatnonzero(level_db > threshold)]
    stretches = join_speech(spoken, HANGOVER_S)
    return join_speech([one for one in stretches if one.end_s - one.start_s > SPEECH_MIN_S])
