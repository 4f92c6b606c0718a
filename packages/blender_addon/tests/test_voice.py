"""Speech by loudness: bursts are found, silence and steady noise are not speech."""

import numpy as np
import pytest
from blender_addon.voice import speech_in_samples

RATE = 16_000


def noise(seconds: float, level: float, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).normal(0, level, int(seconds * RATE)).astype(np.float32)


def test_bursts_of_sound_are_stretches_of_speech() -> None:
    sound = np.concatenate(
        [noise(1, 0.001), noise(2, 0.2), noise(1.5, 0.001), noise(1, 0.1), noise(2, 0.001)]
    )
    stretches = speech_in_samples(sound, RATE)
    assert [one.start_s for one in stretches] == pytest.approx([1.0, 4.5], abs=0.05)
    assert [one.end_s for one in stretches] == pytest.approx([3.0, 5.5], abs=0.05)


@pytest.mark.parametrize("level", [0.0, 0.0002, 0.05])
def test_silence_and_steady_noise_are_not_speech(level: float) -> None:
    assert speech_in_samples(noise(5, level), RATE) == []
    assert speech_in_samples(np.empty(0, np.float32), RATE) == []
