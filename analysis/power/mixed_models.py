"""Power of linear mixed models, for numbers of participants, clips and faces."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from analysis.models.design import ModelData, model_data
from analysis.models.reml import criterion, cross_products
from analysis.models.roles import ModelTerms, RandomSlopes
from analysis.models.satterthwaite import uncertainty
from analysis.models.terms import Term
from analysis.models.variances import fit_theta
from analysis.power.conditions import refuse_no_difference, said_of_differences
from experiments.errors import InputError

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
        Numbers of faces, each tried; empty where faces are no random factor.
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
                raise InputError(
                    f"{clips} clips cannot be shared evenly by {faces} faces"
                    f"{'' if self.crossed else f' in {self.conditions} conditions'}; expected a multiple of "
                    f"{max(cell, 2)}"
                )
            if not self.faces and clips == cell:
                raise InputError(
                    f"{clips} clips are one a condition, and what is the clip's cannot be told from what is "
                    f"the condition's; expected {2 * cell} or more, or --crossed where each clip is shown in "
                    "every condition"
                )
        if self.faces and min(self.faces) < 2:
            raise InputError("expected at least two faces; leave --faces out for a study of one")

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
            else "each condition has as many of the clips"
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
        return np.asarray(own - own.mean(axis=1, keepdims=True), dtype=np.float64)

    def _coded(self, n: int, clips: int, faces: int) -> tuple[ModelData, list[Term]]:
        """Trials and random terms of the model; those of one design are coded once."""
        key = (n, clips, faces)
        if key not in self._known:
            shown = [
                (clip, condition, clip % faces)
                for clip in range(clips)
                for condition in (
                    range(self.conditions) if self.crossed else (clip // faces % self.conditions,)
                )
                for _ in range(self.repeats)
            ]
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
