"""Where somebody speaks by the times of subtitles (WebVTT, SubRip)."""

import shlex
from pathlib import Path

import webvtt
from webvtt.models import Caption

from blink_engine.speech import Speech, joined
from experiments.errors import InputError, did_you_mean

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
            f"{path}: expected one person, got {len(voices)} voices ({', '.join(voices)}); name the one "
            f"whose eyes these are: --speaker {shlex.quote(voices[0])}, in an experiment speech = "
            f'"{path.name}#{voices[0]}"'
        )
    if speaker is not None and speaker not in voices:
        spoken = f"; voices: {', '.join(voices)}" if voices else "; the file names no voices"
        raise InputError(f"{path}: nobody is called '{speaker}'{did_you_mean(speaker, voices)}{spoken}")
    length_s = max((_seconds(caption.end) for caption in captions), default=0.0)
    own = [caption for caption in captions if speaker is None or caption.voice == speaker]
    return joined([_stretch(path, caption) for caption in own]), length_s


def _captions(path: Path) -> list[Caption]:
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
        raise InputError(f"{path}: a subtitle ends at {caption.end}, not after its start at {caption.start}")
    return Speech(start_s, end_s)


def _seconds(stamp: str) -> float:
    seconds = 0.0
    for part in stamp.replace(",", ".").split(":"):
        seconds = seconds * 60.0 + float(part)
    return seconds
