"""Power of linear and ordinal mixed models, for numbers of participants, clips and faces."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import special
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from analysis.models.columns import ModelTerms, RandomSlopes
from analysis.models.design import ModelData, model_data
from analysis.models.fixed_effect_tests import uncertainty
from analysis.models.ordinal import MAXIMUM_CATEGORIES, fit_ordinal
from analysis.models.random_part import fit_theta
from analysis.models.reml import Term, criterion, cross_products
from experiments.errors import InputError
from table_files import counted

# Conditions of a planned study by how far each further one lies from the first.


def refuse_no_difference(differences: Sequence[float]) -> None:
    """Refuse a design without a further condition, and differences that are not numbers."""
    if not differences or not np.isfinite(differences).all():
        raise InputError(
            "power cannot be computed: no condition is compared; add --difference, such as 0.4 or 0.2,0.4"
        )


def confounded(clips: int) -> str:
    """Why as many clips as conditions allow no test."""
    return (
        f"{clips} clips are one per condition, so clip and condition are confounded. Use {2 * clips} clips "
        "or more, or add --crossed if each clip is shown in every condition"
    )


def said_of_differences(differences: Sequence[float]) -> str:
    """The conditions in words, without a unit."""
    if len(differences) == 1:
        return f"Two conditions differ by {differences[0]:g}"
    told = ", ".join(f"{difference:g}" for difference in differences[:-1])
    return (
        f"{len(differences) + 1} conditions, where the others differ from the first by {told} and "
        f"{differences[-1]:g}"
    )


# Power of linear mixed models, for numbers of participants, clips and faces.

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Spreads:
    """Standard deviations of a rating's parts, in rating units.

    Attributes
    ----------
    participant, clip, face : float
        Of the mean rating.
    participant_difference, face_difference : float
        Of the difference between any two conditions.
    residual : float
    """

    participant: float = 0.6
    participant_difference: float = 0.4
    clip: float = 0.3
    face: float = 0.0
    face_difference: float = 0.0
    residual: float = 1.0


@dataclass(frozen=True)
class MixedDesign:
    """Conditions rated by participants who all see every clip; clips of as many faces as are asked for.

    Attributes
    ----------
    differences : tuple of float
        Of every further condition from the first, in rating units.
    clips : tuple of int
        Numbers of clips, each tried; shared evenly by conditions (and faces).
    faces : tuple of int
        Numbers of faces, each tried; empty if faces are not a random factor.
    crossed : bool
        Whether each clip is shown in every condition; else in one, as many in each.
    repeats : int
        Ratings of a clip (in a condition) by a participant.
    spreads : Spreads
    """

    differences: tuple[float, ...]
    clips: tuple[int, ...]
    faces: tuple[int, ...] = ()
    crossed: bool = False
    repeats: int = 1
    spreads: Spreads = Spreads()
    _known: dict[tuple[int, int, int], tuple[ModelData, list[Term]]] = field(
        default_factory=dict, repr=False, compare=False
    )

    def __post_init__(self) -> None:
        refuse_no_difference(self.differences)
        for clips, faces in self._combinations:
            cell = faces * (1 if self.crossed else self.conditions)
            if clips % cell or clips // cell < 1 or clips < 2:
                conditions = [] if self.crossed else [f"{self.conditions} conditions"]
                parts = [f"{faces} faces"] * (faces > 1) + conditions
                if not parts:
                    raise InputError(f"expected at least two clips, got {clips}")
                raise InputError(
                    f"{counted(clips, 'clip')} cannot be divided evenly between {' in '.join(parts)}; "
                    f"expected a multiple of {max(cell, 2)}"
                )
            if not self.faces and clips == cell:
                raise InputError(confounded(clips))
        if self.faces and min(self.faces) < 2:
            raise InputError("expected at least two faces; omit --faces for a study of one face")

    @property
    def conditions(self) -> int:
        """How many there are."""
        return len(self.differences) + 1

    @cached_property
    def _combinations(self) -> tuple[tuple[int, int], ...]:
        return tuple(product(self.clips, self.faces or (1,)))

    @property
    def effects(self) -> tuple[str, ...]:
        """The condition, with each number of clips (and faces)."""
        return tuple(
            f"{clips} clips of {faces} faces" if self.faces else f"{clips} clips"
            for clips, faces in self._combinations
        )

    @property
    def test(self) -> str:
        """The test, in a few words."""
        return "linear mixed model, Satterthwaite"

    @property
    def population(self) -> str:
        """The population in a sentence."""
        s = self.spreads
        said = (
            f"{said_of_differences(self.differences)} rating points; SDs: participants "
            f"{s.participant:g}, their difference {s.participant_difference:g}, clips {s.clip:g}, residual "
            f"{s.residual:g}"
        )
        if self.faces:
            said += f", faces {s.face:g}, their difference {s.face_difference:g}"
        shown = (
            "each clip is shown in every condition"
            if self.crossed
            else "each condition has the same number of clips"
        )
        return (
            f"{said}; {shown}, rated {'once' if self.repeats == 1 else f'{self.repeats} times'} by everybody"
        )

    def p_values(self, n: int, rng: np.random.Generator) -> Sequence[float]:
        """The p of the condition with every number of clips, each from its own data set."""
        # matrices this small only wait for a second thread
        with threadpool_limits(1, "blas"):
            return [self._p(n, clips, faces, rng) for clips, faces in self._combinations]

    def _p(self, n: int, clips: int, faces: int, rng: np.random.Generator) -> float:
        data, terms = self._coded(n, clips, faces)
        c = cross_products(data.x, self._ratings(data, rng), terms)
        theta = fit_theta(c)
        at = criterion(c, theta)
        return uncertainty(c, theta, at).f_test(at.beta, data.differences("condition"))[3]

    def _ratings(self, data: ModelData, rng: np.random.Generator) -> Floats:
        s, condition = self.spreads, data.cell
        people, clip = data.groups[0], data.groups[1]
        y = np.array([0.0, *self.differences])[condition] + rng.normal(0, s.residual, len(condition))
        y += rng.normal(0, s.participant, len(people.names))[people.codes]
        y += self._apart(s.participant_difference, len(people.names), rng)[people.codes, condition]
        y += rng.normal(0, s.clip, len(clip.names))[clip.codes]
        if self.faces:
            face = data.groups[2]
            y += rng.normal(0, s.face, len(face.names))[face.codes]
            y += self._apart(s.face_difference, len(face.names), rng)[face.codes, condition]
        return np.asarray(y, dtype=np.float64)

    def _apart(self, sd: float, levels: int, rng: np.random.Generator) -> Floats:
        """Each level's own part in every condition (levels, conditions): any two differ with this SD."""
        own = rng.normal(0, sd / np.sqrt(2), (levels, self.conditions))
        # Centered, so that the mean over conditions keeps its spread.
        return np.asarray(own - own.mean(axis=1, keepdims=True), dtype=np.float64)

    def _coded(self, n: int, clips: int, faces: int) -> tuple[ModelData, list[Term]]:
        """Trials and random terms of the model; those of one design are coded once."""
        key = (n, clips, faces)
        if key not in self._known:
            shown = [
                # Faces change fastest, so that every face has clips in every condition.
                (clip, condition, clip % faces)
                for clip in range(clips)
                for condition in (
                    range(self.conditions) if self.crossed else (clip // faces % self.conditions,)
                )
                for _ in range(self.repeats)
            ]
            # Its ratings are placeholders: those of a data set are drawn each time.
            rows = pd.DataFrame(
                [(f"p{p}", f"c{c}", f"m{m}", f"f{f}") for p in range(n) for c, m, f in shown],
                columns=["participant", "clip", "condition", "face"],
            ).assign(rating=np.arange(n * len(shown), dtype=np.float64))
            further = ("face",) if self.faces else ()
            data = model_data(
                rows, ModelTerms("participant", "rating", ("condition",), ("clip",), random=further)
            )
            slopes: RandomSlopes = "main" if self.faces else "none"
            self._known[key] = data, data.random_terms("main", ["intercept", "condition"], slopes)
        return self._known[key]


# Power of ordinal mixed models: ratings as ordered categories.


@dataclass(frozen=True)
class OrdinalDesign:
    r"""Conditions rated on ordered categories by participants who all see every clip.

    Attributes
    ----------
    differences : tuple of float
        Of every further condition from the first, in log odds of a higher category.
    shares : tuple of float
        How often each category is given to a clip of the first condition by a participant, both without
        individual bias; they are divided by their sum.
    clips : int
        Shared evenly by the conditions.
    crossed : bool
        Whether each clip is shown in every condition; else in one, as many in each.
    sd_participant, sd_slope, sd_clip : float
        In log odds: of participants, of their differences between any two conditions, of clips.

    Notes
    -----
    :math:`P(y \le k) = \mathrm{logit}^{-1}(\theta_k - \eta)`, with :math:`\theta_k` the log odds of the
    cumulated shares.
    """

    differences: tuple[float, ...]
    shares: tuple[float, ...]
    clips: int
    crossed: bool = False
    sd_participant: float = 1.0
    sd_slope: float = 0.5
    sd_clip: float = 0.5

    def __post_init__(self) -> None:
        if not 2 <= len(self.shares) <= MAXIMUM_CATEGORIES or min(self.shares) <= 0:
            raise InputError(
                f"expected the shares of 2 to {MAXIMUM_CATEGORIES} categories, all above 0: 5,15,30,30,20"
            )
        refuse_no_difference(self.differences)
        if self.clips < 2 or (not self.crossed and self.clips % self.conditions):
            if self.crossed:
                raise InputError(f"expected at least 2 clips, got {self.clips}")
            raise InputError(
                f"{counted(self.clips, 'clip')} cannot be divided evenly between {self.conditions} "
                f"conditions; use a multiple of {self.conditions}, or add --crossed"
            )
        if not self.crossed and self.clips == self.conditions:
            raise InputError(confounded(self.clips))

    @property
    def conditions(self) -> int:
        """How many there are."""
        return len(self.differences) + 1

    @property
    def effects(self) -> tuple[str, ...]:
        """The one test."""
        return ("condition",)

    @property
    def test(self) -> str:
        """The test, in a few words."""
        return "cumulative logit mixed model, Wald"

    @property
    def population(self) -> str:
        """The population in a sentence."""
        shares = ", ".join(f"{share:.0%}" for share in self._shares)
        shown = "each shown in every condition" if self.crossed else "as many in each condition"
        odds = ", ".join(f"{np.exp(difference):.3g}" for difference in self.differences)
        which = "the second" if self.conditions == 2 else "the further conditions"
        return (
            f"Ratings in {len(self.shares)} categories with shares {shares} in the first condition; the odds "
            f"of a higher category are {odds} times as large in {which}; SDs in log odds: participants "
            f"{self.sd_participant:g}, their difference {self.sd_slope:g}, clips {self.sd_clip:g}; "
            f"{self.clips} clips, {shown}, rated once by everybody"
        )

    @property
    def _shares(self) -> Floats:
        given = np.array(self.shares, dtype=np.float64)
        shares: Floats = given / given.sum()
        return shares

    @cached_property
    def _shown(self) -> NDArray[np.int64]:
        """Clip and condition of each of a participant's trials (trials, 2)."""
        clip = np.arange(self.clips)
        if not self.crossed:
            return np.stack([clip, clip % self.conditions], axis=1)
        every = np.arange(self.conditions)
        return np.stack([np.tile(clip, self.conditions), np.repeat(every, self.clips)], axis=1)

    def drawn(self, n: int, rng: np.random.Generator) -> pd.DataFrame:
        """One data set: participant, clip, condition and rating (1 for the first category) of each trial."""
        clip, condition = np.tile(self._shown, (n, 1)).T
        person = np.repeat(np.arange(n), len(self._shown))
        own = self.sd_slope / np.sqrt(2) * rng.normal(size=(n, self.conditions))
        # Against the first condition, whose spread stays `sd_participant`; any two differ by `sd_slope`.
        apart = np.array([0.0, *self.differences]) + own - own[:, :1]
        eta = self.sd_participant * rng.normal(size=n)[person] + apart[person, condition]
        eta = eta + self.sd_clip * rng.normal(size=self.clips)[clip]
        thresholds = special.logit(np.cumsum(self._shares)[:-1])
        # Logistic noise makes the share below a threshold the inverse logit of the model.
        noise = special.logit(rng.uniform(size=len(eta)))
        rating = 1 + (thresholds < (eta + noise)[:, None]).sum(axis=1)
        columns = {"participant": person, "clip": clip, "condition": condition, "rating": rating}
        return pd.DataFrame(columns)

    def p_values(self, n: int, rng: np.random.Generator) -> Sequence[float]:
        """The p of the condition; NaN where the data leave it undetermined."""
        rows = self.drawn(n, rng).astype(dict.fromkeys(("participant", "clip", "condition"), str))
        try:
            model = fit_ordinal(rows, "participant", "rating", ["condition"], "clip", "main", quadrature=1)
        except InputError:
            return [float("nan")]
        return [model.effects[0].p_value]
