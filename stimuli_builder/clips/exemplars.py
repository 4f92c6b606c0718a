"""Which blink an exemplar shows: recorded, drawn from the model, a textbook curve, or from a file."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pandas as pd

from experiments.declaration.rendering import PROFILES, RenderSettings
from experiments.errors import InputError, nearest
from stimuli_builder.blinks.blink_model import (
    TEXTBOOK_KINDS,
    BlinkModel,
    PhaseModel,
    TextbookKind,
    default_model,
    textbook_profile,
)
from stimuli_builder.blinks.csv_table import NOTE, read_table
from stimuli_builder.blinks.library import load_library
from stimuli_builder.blinks.profile import Array, BlinkProfile, read_profile_table, resample
from stimuli_builder.clips.curves import amplitude_of, generator, samples_per_frame

# Blinks from files of closure samples at 300 fps: a table of profiles, or one blink alone.

COLUMNS = ("closure", "closure_other", "lower_up_mm", "lower_nasal_mm")
NEAR = 0.7
"""Below it `score` would be taken for `closure`."""
FORMATS = (
    "expected one blink (a column closure, 0 open to 1 closed, at 300 fps) or a table of profiles "
    "(NAME.profiles.csv of `stimuli blinks`, with a column profile_id)"
)


def read_closure_file(path: Path) -> list[BlinkProfile]:
    """Read blinks from a CSV file.

    A file with a column `profile_id` is a table of profiles as `stimuli blinks` writes it. Any other
    holds one blink: a column `closure` (0 open, 1 closed) at 300 fps, and where wanted `closure_other`
    (right eye), `lower_up_mm` and `lower_nasal_mm`; or numbers alone, one per line. Semicolons, tabs and
    decimal commas are read as in a series (`stimuli_builder.blinks.csv_table`).

    Raises
    ------
    InputError
        The file is missing, has no closure, or a sample is not a number between 0 and 1.
    """
    table = _table(path)
    if "profile_id" in table.columns:
        return read_profile_table(path)
    if "closure" not in table.columns:
        # Names that are known mean something else and are not misspelled.
        near = nearest("closure", [str(name) for name in table.columns if name not in COLUMNS], NEAR)
        hint = f"did you mean '{near}'?" if near else FORMATS
        raise InputError(f"{path.name}: no column 'closure'; {hint}")
    signals = {name: _numbers(path, table, name) for name in COLUMNS if name in table.columns}
    closure = signals["closure"]
    if len(closure) < 3:
        raise InputError(f"{path.name}: expected at least 3 samples of closure, found {len(closure)}")
    for name, values in signals.items():
        if name.startswith("closure"):
            _require_closure(path, name, values)
    minimum = int(np.argmax(closure))
    # Otherwise half a blink, whose other half would jump.
    if not 0 < minimum < len(closure) - 1:
        raise InputError(
            f"{path.name}: the greatest closure must be inside the blink, but it is sample {minimum + 1} of "
            f"{len(closure)}; add the closing and the opening"
        )
    return [
        BlinkProfile(
            profile_id=f"file-{path.stem}",
            closure=closure,
            minimum_index=minimum,
            down_frames=minimum,
            up_frames=len(closure) - 1 - minimum,
            amplitude=float(np.ptp(closure)),
            source=f"file {path.name}",
            # One curve without a name may be of either eye.
            eye="both" if "closure_other" in signals else None,
            closure_other=signals.get("closure_other"),
            lower_up_mm=signals.get("lower_up_mm"),
            lower_nasal_mm=signals.get("lower_nasal_mm"),
        )
    ]


def reading_note(path: Path) -> str:
    """How the cells of such a file were read, where that is not plain: for the person who gave it to see."""
    return str(_table(path).attrs.get(NOTE, ""))


def _table(path: Path) -> pd.DataFrame:
    """The cells, without blank lines at the end; one among samples is a sample that is missing."""
    table = read_table(path, alone="closure", as_written=True)
    filled = np.flatnonzero(table.notna().any(axis=1))
    return table.iloc[: filled[-1] + 1 if len(filled) else 0]


def _numbers(path: Path, table: pd.DataFrame, name: str) -> Array:
    values = pd.to_numeric(table[name], errors="coerce").to_numpy(dtype=np.float64)
    wrong = np.flatnonzero(~np.isfinite(values))
    if len(wrong):
        # Next to a word, decimal commas are still commas; the word is the error.
        cells = table[name].astype(str).str.replace(",", ".")
        words = np.flatnonzero(pd.to_numeric(cells, errors="coerce").isna())
        sample = int([*words, *wrong][0])
        cell = table[name].iloc[sample]
        said = "missing" if pd.isna(cell) else f"'{cell}'"
        raise InputError(f"{path.name}: {name} must be a number, sample {sample + 1} is {said}")
    return values


def _require_closure(path: Path, name: str, values: Array) -> None:
    outside = np.flatnonzero((values < 0) | (values > 1))
    if len(outside):
        raise InputError(
            f"{path.name}: {name} must lie between 0 (open) and 1 (closed), sample {outside[0] + 1} is "
            f"{values[outside[0]]:g}"
        )


@dataclass(frozen=True, eq=False)
class Exemplar:
    """A blink in its condition, and whether its recording already stands for another exemplar."""

    profile: BlinkProfile
    repeated: bool
    phase_samples: int


def exemplar(
    settings: RenderSettings, family: str, number: int, seed: int, beside: Path | None = None
) -> Exemplar:
    """Return exemplar `number` (from 1) of a family of exemplars.

    Parameters
    ----------
    family : str
        Key shared by all cells that show the same blinks (their levels of the factors in `own_per`);
        with `seed` it decides every random choice.
    beside : Path, optional
        Folder that profile files are relative to.
    """
    profile, repeated = _blink(settings, family, number, seed, beside)
    # Textbook curves are made at the declared length.
    if settings.profile not in TEXTBOOK_KINDS:
        profile = of_declared_length(profile, settings)
    # Alike: both eyes show the left curve.
    if settings.eyes == "alike" and profile.closure_other is not None:
        profile = replace(profile, closure_other=None)
    # As many onsets as samples begin within one frame: 10 at 30 fps, 12 at 24 and 25, 6 at 50, 5 at 60.
    phases = generator("phase", seed, family).permutation(int(samples_per_frame(settings.fps)))
    # In turn: every onset comes once before any comes twice.
    phase = int(phases[(number - 1) % len(phases)])
    return Exemplar(amplitude_of(profile, settings.amplitude), repeated, phase)


def number_of_blinks(settings: RenderSettings) -> int | None:
    """How many different blinks a recorded profile or a file has; None if any number can be made."""
    if settings.profile == "real":
        return len(load_library(paired=settings.eyes == "separate"))
    return None if settings.profile in PROFILES else len(read_closure_file(Path(settings.profile)))


def of_declared_length(profile: BlinkProfile, settings: RenderSettings) -> BlinkProfile:
    """The blink scaled to the declared duration, or as it is where none is declared."""
    frames = _frames_30fps(settings)
    return profile if frames is None else resample(profile, frames)


def _frames_30fps(settings: RenderSettings) -> float | None:
    # Rounded to what a declaration can mean, without binary rounding errors.
    return None if settings.blink_ms is None else round(settings.blink_ms * 30 / 1000, 9)


def recorded_order(
    count: int, seed: int, family: str, *, paired: bool = False
) -> list[tuple[BlinkProfile, bool]]:
    """The recorded blinks of `count` exemplars, each with whether it came before.

    Every recording is used once, in an order drawn by the seed, before any is used twice.
    """
    return _in_turn(load_library(paired=paired), count, seed, family)


def _in_turn(
    profiles: Sequence[BlinkProfile], count: int, seed: int, family: str
) -> list[tuple[BlinkProfile, bool]]:
    order = generator("recorded", seed, family).permutation(len(profiles))
    # The order is drawn once by family, so a greater count keeps the first ones.
    return [(profiles[order[i % len(order)]], i >= len(order)) for i in range(count)]


def _blink(
    settings: RenderSettings, family: str, number: int, seed: int, beside: Path | None
) -> tuple[BlinkProfile, bool]:
    separate = settings.eyes == "separate"
    kind = settings.profile
    if kind == "real":
        # This exemplar is the last one drawn.
        return recorded_order(number, seed, family, paired=separate)[-1]
    if kind == "model":
        # A separate stream for each exemplar: more of them leave the others as they are.
        rng = generator("model", seed, family, number)
        return (_paired_model() if separate else default_model()).sample(rng=rng), False
    if kind == "phases":
        return _drawn_by_phases(family, number, seed, separate), False
    for textbook in TEXTBOOK_KINDS:
        if kind == textbook:
            return _textbook(textbook, settings, family, number, seed), False
    # No built-in name: the path of a file.
    profiles = read_closure_file(_path_next_to(kind, beside))
    if separate and any(profile.closure_other is None for profile in profiles):
        raise InputError(f"{kind}: eyes = 'separate' needs a column closure_other for the right eye")
    return _in_turn(profiles, number, seed, family)[-1]


def _textbook(
    kind: TextbookKind, settings: RenderSettings, family: str, number: int, seed: int
) -> BlinkProfile:
    """A textbook blink that begins and ends at rest, as recorded and modeled ones do (decision 0975)."""
    rng = generator("textbook", seed, family, number)
    # Duration and closure of a recorded blink: only the shape is from the textbook.
    recorded = load_library()[int(rng.integers(len(load_library())))]
    peak = 1.0 if settings.amplitude == "full" else float(recorded.closure.max())
    duration = _frames_30fps(settings) or recorded.duration_frames_30fps
    return textbook_profile(kind, duration, peak_closure=peak)


def _drawn_by_phases(family: str, number: int, seed: int, separate: bool) -> BlinkProfile:
    if separate:
        raise InputError(
            "profile 'phases' has blinks of one eye; use eyes = 'alike', or profile 'real' or 'model' for "
            "eyes that move separately"
        )
    rng = generator("phases", seed, family, number)
    return _phase_model().sample(None, rng, profile_id=f"phases-{seed}-{family}-{number}")


# Fitted once for all exemplars of a build.
@lru_cache(maxsize=1)
def _phase_model() -> PhaseModel:
    return PhaseModel.fit(load_library())


@lru_cache(maxsize=1)
def _paired_model() -> BlinkModel:
    """The model of both eyes together, fitted to the blinks seen in both."""
    return BlinkModel.fit(load_library(paired=True))


def _path_next_to(file: str, folder: Path | None) -> Path:
    return (folder or Path()) / file
