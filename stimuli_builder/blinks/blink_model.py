"""The PCA blink model: learns from recorded profiles, makes new ones (paper 3.3.2, Figure 7)."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from experiments.errors import InputError
from experiments.files import whole_text
from stimuli_builder.blinks.profile import (
    PROFILE_FPS,
    Array,
    BlinkProfile,
    phase_spline,
    resample,
    resample_phases,
    with_minimum_at_peak,
)

SHIPPED_MODEL = Path(__file__).parent / "library" / "model.json"
MODEL_FORMAT = "palpebra-blink-model-1"
MAX_DRAWS = 1000


@dataclass(frozen=True, eq=False)
class BlinkModel:
    """Principal components of length-normalised blinks, with their two scaling factors.

    A row of the data matrix is [closure of the closing phase, of the opening phase (of the second eye
    likewise, where there is one), weight x down-phase scale, weight x up-phase scale].

    Parameters
    ----------
    mean : (d,) array
    components : (k, d) array
        Orthonormal rows, greatest variance first.
    coefficient_sd : (k,) array
        Standard deviation of the training blinks' coefficients.
    explained : (k,) array
        Share of the variance each kept component carries.
    down_frames, up_frames : int
        Mean phase lengths at 300 fps, to which blinks are normalised.
    scale_weight : float
        Weight of the scaling-factor columns, see `fit`.
    eyes : int
        1, or 2 where left/right asymmetry is modelled.
    trained_on : tuple of str
        Names of the training profiles.
    """

    mean: Array
    components: Array
    coefficient_sd: Array
    explained: Array
    down_frames: int
    up_frames: int
    scale_weight: float
    eyes: int
    trained_on: tuple[str, ...]

    @classmethod
    def fit(cls, profiles: Sequence[BlinkProfile], components: int = 5) -> "BlinkModel":
        """Fit the model to recorded profiles; two-eyed when every profile has both eyes.

        The scaling-factor columns get the weight that gives them together the same variance as all
        closure samples together: the energy normalisation the paper uses to couple shape and
        appearance (equation 5), so that neither timing nor form rules the components.
        """
        if len(profiles) < 3:
            raise InputError(f"the blink model needs 3 profiles or more, got {len(profiles)}")
        if not 1 <= components < len(profiles):
            raise InputError(
                f"{len(profiles)} profiles allow 1 to {len(profiles) - 1} components, got {components}"
            )
        eyes = 2 if all(profile.closure_other is not None for profile in profiles) else 1
        down = round(float(np.mean([profile.down_frames for profile in profiles])))
        up = round(float(np.mean([profile.up_frames for profile in profiles])))
        form = np.array([_normalised(profile, down, up, eyes) for profile in profiles])
        scales = np.array([[p.down_frames / down, p.up_frames / up] for p in profiles])
        weight = _energy_weight(form, scales)
        data = np.hstack([form, weight * scales])
        mean = data.mean(axis=0)
        _, singular, rows = np.linalg.svd(data - mean, full_matrices=False)
        variance = singular**2 / (len(profiles) - 1)
        return cls(
            mean=mean,
            components=_signed(rows[:components]),
            coefficient_sd=np.sqrt(variance[:components]),
            explained=variance[:components] / max(variance.sum(), 1e-30),
            down_frames=down,
            up_frames=up,
            scale_weight=weight,
            eyes=eyes,
            trained_on=tuple(profile.profile_id for profile in profiles),
        )

    @property
    def variance_kept(self) -> float:
        """Share of the variance all kept components carry together."""
        return float(self.explained.sum())

    def coefficients(self, profile: BlinkProfile) -> Array:
        """Return the (k,) coefficients of a profile in the space of the model."""
        form = _normalised(profile, self.down_frames, self.up_frames, self.eyes)
        scales = np.array([profile.down_frames / self.down_frames, profile.up_frames / self.up_frames])
        return self.components @ (np.concatenate([form, self.scale_weight * scales]) - self.mean)

    def normalised_forms(self, coefficients: Array) -> tuple[Array, float, float]:
        """Closure (eyes, down + up + 1) at mean length and the two scaling factors, for (k,) coefficients."""
        row = self.mean + coefficients @ self.components
        form = row[:-2].reshape(self.eyes, self.down_frames + self.up_frames + 1)
        return form, float(row[-2] / self.scale_weight), float(row[-1] / self.scale_weight)

    def profile(self, coefficients: Array, profile_id: str) -> BlinkProfile | None:
        """Return the blink of these coefficients, or None where its inter-eyelid distance is negative.

        A closure above 1 is a negative distance: the paper drops such blinks. A closure below 0, an eye
        opened wider than its reference, is cut to 0.
        """
        form, down_scale, up_scale = self.normalised_forms(coefficients)
        down, up = round(self.down_frames * down_scale), round(self.up_frames * up_scale)
        if form.max() > 1.0 or down < 1 or up < 1:
            return None
        closure = np.round(np.maximum(form, 0.0), 9)
        normal = BlinkProfile(
            profile_id=profile_id,
            closure=closure[0],
            minimum_index=self.down_frames,
            down_frames=self.down_frames,
            up_frames=self.up_frames,
            amplitude=float(np.ptp(closure[0])),
            source="PCA blink model",
            eye="both" if self.eyes == 2 else None,
            closure_other=closure[1] if self.eyes == 2 else None,
        )
        return with_minimum_at_peak(resample_phases(normal, down, up))

    def sample(
        self,
        duration_frames_30fps: float | None = None,
        rng: np.random.Generator | None = None,
        *,
        profile_id: str | None = None,
    ) -> BlinkProfile:
        """Draw a new blink: coefficients even within one standard deviation, negative blinks drawn again.

        Given a duration (frames at 30 fps) the blink is scaled to it, the drawn ratio of phases kept;
        without one its length is the drawn one. The same generator state gives the same blink.
        """
        generator = np.random.default_rng() if rng is None else rng
        for _ in range(MAX_DRAWS):
            relative = generator.uniform(-1.0, 1.0, self.coefficient_sd.size)
            name = profile_id or "model-" + "-".join(f"{value * 1000:+.0f}" for value in relative)
            blink = self.profile(relative * self.coefficient_sd, name)
            if blink is not None:
                return blink if duration_frames_30fps is None else resample(blink, duration_frames_30fps)
        raise InputError(
            f"the model gave {MAX_DRAWS} blinks with a negative distance in a row: fit it to other profiles"
        )

    def save(self, path: Path) -> None:
        """Write the model as JSON."""
        content = {
            "format": MODEL_FORMAT,
            "fps": PROFILE_FPS,
            "eyes": self.eyes,
            "down_frames": self.down_frames,
            "up_frames": self.up_frames,
            "scale_weight": self.scale_weight,
            "explained": self.explained.tolist(),
            "coefficient_sd": self.coefficient_sd.tolist(),
            "trained_on": list(self.trained_on),
            "mean": np.round(self.mean, 9).tolist(),
            "components": np.round(self.components, 9).tolist(),
        }
        with whole_text(path) as stream:
            stream.write(json.dumps(content, indent=1) + "\n")

    @classmethod
    def load(cls, path: Path) -> "BlinkModel":
        """Read a model written by `save`."""
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            if content["format"] != MODEL_FORMAT:
                raise InputError(
                    f"{path.name}: expected the format {MODEL_FORMAT}, got {content['format']!r}"
                )
            numbers = {
                key: np.array(content[key]) for key in ("mean", "components", "coefficient_sd", "explained")
            }
            return cls(
                **numbers,
                down_frames=int(content["down_frames"]),
                up_frames=int(content["up_frames"]),
                scale_weight=float(content["scale_weight"]),
                eyes=int(content["eyes"]),
                trained_on=tuple(content["trained_on"]),
            )
        except OSError as error:
            raise InputError(
                f"{path}: cannot be read ({error.strerror}); `stimuli model fit` makes a model"
            ) from error
        except InputError:
            raise
        except (ValueError, KeyError, TypeError) as error:
            raise InputError(f"{path}: not a blink model ({error}); `stimuli model fit` makes one") from error


@lru_cache(maxsize=1)
def default_model() -> BlinkModel:
    """Return the shipped model, fitted to the shipped profiles."""
    return BlinkModel.load(SHIPPED_MODEL)


def _normalised(profile: BlinkProfile, down_frames: int, up_frames: int, eyes: int) -> Array:
    eye_closures = [profile.closure] if eyes == 1 else [profile.closure, profile.closure_other]
    middle, parts = profile.minimum_index, []
    for closure in eye_closures:
        if closure is None:
            raise InputError(f"profile {profile.profile_id} has one eye; this model needs both")
        parts.append(phase_spline(closure[profile.onset_index : middle + 1], down_frames))
        parts.append(phase_spline(closure[middle : profile.end_index + 1], up_frames)[1:])
    return np.concatenate(parts)


def _energy_weight(form: Array, scales: Array) -> float:
    timing = float(scales.var(axis=0).sum())
    return 1.0 if timing < 1e-12 else float(np.sqrt(form.var(axis=0).sum() / timing)) or 1.0


def _signed(rows: Array) -> Array:
    """Fix each component's sign (its largest entry positive): an SVD leaves it to the machine."""
    largest = rows[np.arange(len(rows)), np.abs(rows).argmax(axis=1)]
    return rows * np.where(largest < 0, -1.0, 1.0)[:, None]
