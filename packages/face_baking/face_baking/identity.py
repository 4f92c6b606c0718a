"""What makes one face: its seed and shape, pigments, age, hair, iris and what moves in its blink."""

import tomllib
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from experiments.errors import InputError, did_you_mean, wrong_value
from face_baking.field_noise import value_noise
from face_baking.kit import MODES, SKIN_FACES, Array, FaceKit

IDENTITIES_FILE = Path(__file__).with_name("identities.toml")
MAX_SEED = 999_999
MAX_DEVIATIONS = 1.6
"""Identity modes stay within this many standard deviations: the kit's scans hold few faces beyond."""
UNEVEN_CM, UNEVEN_PER_CM = 0.05, 0.3
"""Waves that make the halves of a face differ: size, and how many per cm. The kit's modes are symmetrical."""
Share = Annotated[float, Field(ge=0, le=1)]
Colour = tuple[Share, Share, Share]


class _Declared(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Skin(_Declared):
    """Pigments as optical depths, and what time does to skin."""

    melanin: float = Field(ge=0.05, le=1.6, description="0.15 is very light, 0.5 olive, 1.1 dark brown")
    haemoglobin: float = Field(ge=0.1, le=0.8, description="0.3 is ordinary, 0.5 ruddy")
    freckles: float = Field(0.6, ge=0, le=4, description="strength of freckles and small moles")
    age: float = Field(32, ge=18, le=80, description="years: depth of lines, furrows and pores, mottling")


class Lids(_Declared):
    """The upper lid's fold."""

    crease: float = Field(
        7.4, ge=6, le=9, description="height of the fold in loops of the mesh above the margin"
    )
    depth: float = Field(1.0, ge=0, le=1.6, description="depth of the fold, relative")


class Iris(_Declared):
    """Linear-light colors of the iris from limbus to pupil."""

    outer: Colour
    middle: Colour
    inner: Colour
    pupil_mm: float = Field(3.8, ge=2, le=7)


class Hair(_Declared):
    """Linear-light color of brows, lashes being darker; amounts relative to the first identity."""

    colour: Colour
    brow: float = Field(1.0, ge=0, le=2)
    brow_thickness: float = Field(1.0, ge=0.3, le=1.6)
    lashes: float = Field(1.0, ge=0, le=2)
    lash_length: float = Field(1.0, ge=0.4, le=1.5)


class Movement(_Declared):
    """What moves besides the upper lid, at full closure. 0 holds it still."""

    lower_lid_rise: float = Field(1.0, ge=0, le=1, description="share of the kit's rise of the lower lid")
    lower_lid_slide: float = Field(0.0, ge=0, le=1, description="share of the kit's slide toward the nose")
    cheek: float = Field(0.0, ge=0, le=0.3, description="weight of cheekSquint")
    squint: float = Field(0.0, ge=0, le=0.3, description="weight of eyeSquint")
    brow: float = Field(0.0, ge=0, le=0.3, description="weight of browDown")
    gaze_down_degrees: float = Field(0.0, ge=0, le=10)
    gaze_in_degrees: float = Field(0.0, ge=0, le=5)


class Identity(_Declared):
    """One face. `seed` draws its shape and every random detail, so that it is the same at every bake."""

    label: str
    seed: int = Field(ge=0, le=MAX_SEED)
    spread: float = Field(0.65, ge=0, le=1, description="standard deviation of the shape's modes, in SDs")
    exposure_ev: float = Field(0.0, ge=-3, le=3)
    skin: Skin
    lids: Lids = Lids()
    iris: Iris
    hair: Hair
    movement: Movement = Movement()

    def weights(self) -> Array:
        """(40,) weights of the modes in standard deviations, within `MAX_DEVIATIONS`; 0 is the mean."""
        drawn = np.random.default_rng([self.seed, 1]).normal(0, 1, MODES) * self.spread
        bounded: Array = np.clip(drawn if self.seed else np.zeros(MODES), -MAX_DEVIATIONS, MAX_DEVIATIONS)
        return bounded

    def rest(self, kit: FaceKit) -> Array:
        """(26719, 3) vertices of this face at rest."""
        out = kit.neutral + np.tensordot(self.weights(), kit.modes, 1)
        skin = np.unique(kit.faces[:SKIN_FACES])[1:]
        waves = [value_noise(out[skin] * UNEVEN_PER_CM, self.seed + 60 + k, 1) for k in range(3)]
        out[skin] += UNEVEN_CM * np.stack(waves, -1)
        return np.asarray(out)


def load_identity(name: str, file: Path = IDENTITIES_FILE) -> Identity:
    """One declared identity; InputError names the nearest, or the first fault of its declaration."""
    try:
        content = tomllib.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"cannot read identities from {file}: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{file} is not TOML: {error}") from error
    if name not in content:
        raise InputError(f"no identity '{name}' in {file.name}{did_you_mean(name, content)}")
    try:
        return Identity.model_validate(content[name])
    except ValidationError as error:
        fault = error.errors()[0]
        where = ".".join(str(part) for part in (name, *fault["loc"]))
        raise InputError(f"{file}: {where}: {wrong_value(fault)}") from error


def identity_of_seed(seed: int) -> Identity:
    """A face that the seed decides whole: shape, skin light to dark, age 20 to 65, iris and hair to match.

    Raises
    ------
    InputError
        The seed lies outside 0 to 999,999.
    """
    if not 0 <= seed <= MAX_SEED:
        raise InputError(f"an identity's seed must lie between 0 and {MAX_SEED}; it is {seed}")
    rng = np.random.default_rng([seed, 2])
    melanin = float(np.round(0.15 + 1.0 * rng.random() ** 1.5, 3))
    return Identity(
        label=f"Face of seed {seed}",
        seed=seed,
        skin=Skin(
            melanin=melanin,
            haemoglobin=float(np.round(0.27 + 0.12 * rng.random() + 0.14 * min(melanin, 1.0), 3)),
            freckles=float(np.round(rng.uniform(0.3, 1.6), 2)),
            age=float(rng.integers(20, 66)),
        ),
        lids=Lids(
            crease=float(np.round(rng.uniform(6.8, 8.2), 2)), depth=float(np.round(rng.uniform(0.7, 1.2), 2))
        ),
        iris=_iris(rng, melanin),
        hair=Hair(
            colour=_hair_colour(rng, melanin),
            brow=float(np.round(rng.uniform(0.7, 1.25), 2)),
            brow_thickness=float(np.round(rng.uniform(0.75, 1.25), 2)),
            lash_length=float(np.round(rng.uniform(0.85, 1.12), 2)),
        ),
    )


BLUE = Iris(outer=(0.035, 0.06, 0.085), middle=(0.10, 0.145, 0.165), inner=(0.15, 0.12, 0.07))
GREEN = Iris(outer=(0.035, 0.055, 0.04), middle=(0.11, 0.13, 0.07), inner=(0.16, 0.10, 0.035))
BROWN = Iris(outer=(0.022, 0.010, 0.004), middle=(0.065, 0.028, 0.010), inner=(0.085, 0.038, 0.014))


def _iris(rng: np.random.Generator, melanin: float) -> Iris:
    """Brown eyes with dark skin; any color with light skin."""
    drawn = rng.random()
    if melanin > 0.45 or drawn < 0.35:
        return BROWN
    return BLUE if drawn < 0.7 else GREEN


def _hair_colour(rng: np.random.Generator, melanin: float) -> Colour:
    dark, light = np.array([0.006, 0.0045, 0.004]), np.array([0.045, 0.026, 0.014])
    share = rng.random() * max(0.0, 1 - melanin / 0.5)
    red, green, blue = np.round(dark + share * (light - dark), 4).tolist()
    return red, green, blue
