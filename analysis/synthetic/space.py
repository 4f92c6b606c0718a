"""The design as matrices: which cells a place covers, which contrasts an effect has."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from analysis.within.contrasts import effect_members, effect_name, orthonormal_basis
from experiments.definition import Experiment
from experiments.design import rated_levels
from experiments.errors import InputError, did_you_mean

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class DesignSpace:
    """Cells of a factorial design, last factor fastest."""

    factors: tuple[str, ...]
    levels: tuple[tuple[str, ...], ...]

    @classmethod
    def of(cls, experiment: Experiment) -> "DesignSpace":
        """Factors in the order of the experiment's analysis plan, with the levels that are rated."""
        order = experiment.analysis.factors or experiment.factor_names
        return cls(tuple(order), tuple(tuple(rated_levels(experiment, f)) for f in order))

    @property
    def shape(self) -> tuple[int, ...]:
        """Levels of each factor."""
        return tuple(len(names) for names in self.levels)

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return int(np.prod(self.shape))

    @cached_property
    def effects(self) -> dict[str, Floats]:
        """Orthonormal contrasts (cells, q) of every effect, main effects first."""
        return {
            effect_name([self.factors[m] for m in members]): self._contrasts(members)
            for members in effect_members(len(self.factors))
        }

    def _contrasts(self, members: Sequence[int]) -> Floats:
        block = np.ones((1, 1))
        for axis, size in enumerate(self.shape):
            basis = orthonormal_basis(size)
            block = np.asarray(np.kron(block, basis[:, 1:] if axis in members else basis[:, :1]))
        return block

    def weights(self, at: Mapping[str, str]) -> Floats:
        """Averaging weights (cells,) of a margin or cell; InputError for an unknown factor or level."""
        weight: Floats = np.ones(1)
        for factor, level in at.items():
            self._check(factor, level)
        for factor, names in zip(self.factors, self.levels, strict=True):
            chosen = [at[factor]] if factor in at else list(names)
            weight = np.asarray(np.kron(weight, np.array([name in chosen for name in names]) / len(chosen)))
        return weight

    def _check(self, factor: str, level: str) -> None:
        if factor not in self.factors:
            raise InputError(f"no factor '{factor}'{did_you_mean(factor, self.factors)}")
        names = self.levels[self.factors.index(factor)]
        if level not in names:
            raise InputError(f"'{level}' is no level of '{factor}'{did_you_mean(level, names)}")

    def levels_of(self, factor: str) -> tuple[str, ...]:
        """Level names of a factor."""
        if factor not in self.factors:
            raise InputError(f"no factor '{factor}'{did_you_mean(factor, self.factors)}")
        return self.levels[self.factors.index(factor)]

    def effect_called(self, name: str) -> str:
        """The effect whose factors are those of `name`, in the design's own order."""
        factors = name.split(":")
        for effect in self.effects:
            if sorted(effect.split(":")) == sorted(factors):
                return effect
        raise InputError(f"no effect '{name}'{did_you_mean(name, self.effects)}")
