"""Reading a recording: WAV by Python, everything else by Blender's own audio library."""

import wave
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt

from blender_addon.rig import RigError

RATE_HZ = 16_000
_SAMPLES: dict[int, Any] = {1: np.uint8, 2: np.dtype("<i2"), 4: np.dtype("<i4")}


def read_sound(path: str) -> tuple[npt.NDArray[np.float32], float]:
    """Mono samples between -1 and 1, and how many there are a second.

    Raises
    ------
    RigError
        There is no such file, or it holds no sound that can be read.
    """
    if not path:
        raise RigError("choose a recording of the voice first")
    file = Path(bpy.path.abspath(path))
    if not file.is_file():
        raise RigError(f"{file}: there is no such file; expected a sound file that Blender can read")
    try:
        return _wav(file) if file.suffix.lower() == ".wav" else _by_blender(file)
    except RigError:
        raise
    except Exception as error:  # aud raises kinds of its own
        raise RigError(f"{file}: expected a sound file that Blender reads ({error})") from error


def _wav(file: Path) -> tuple[npt.NDArray[np.float32], float]:
    with wave.open(str(file), "rb") as sound:
        width, channels, rate = sound.getsampwidth(), sound.getnchannels(), sound.getframerate()
        if width not in _SAMPLES:
            return _by_blender(file)
        raw = np.frombuffer(sound.readframes(sound.getnframes()), _SAMPLES[width])
    offset, full = (128, 128) if width == 1 else (0, 2 ** (8 * width - 1))
    values = (raw.astype(np.float64) - offset) / full
    mono = values[: values.size // channels * channels].reshape(-1, channels).mean(axis=1)
    return mono.astype(np.float32), float(rate)


def _by_blender(file: Path) -> tuple[npt.NDArray[np.float32], float]:
    import aud

    return np.asarray(aud.Sound(str(file)).rechannel(1).resample(RATE_HZ, 1).data()[:, 0]), RATE_HZ
