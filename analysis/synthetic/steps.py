"""Ratings counted in the steps of their scale, so that sums of ratings are whole numbers."""

from dataclasses import dataclass, replace

from analysis.synthetic.targets import MeanTarget, Targets
from experiments.trials.scales import RatedScale


@dataclass(frozen=True)
class Steps:
    """Rating r = offset + size k, with k a whole number from `low` to `high`."""

    offset: float
    size: float
    low: int
    high: int

    @classmethod
    def of(cls, scale: RatedScale) -> "Steps":
        """The steps of a scale; without an offset where its lowest rating is a whole number of steps."""
        lowest = scale.minimum / scale.step
        offset = 0.0 if abs(lowest - round(lowest)) < 1e-9 else scale.minimum
        low = round((scale.minimum - offset) / scale.step)
        return cls(offset, scale.step, low, low + round((scale.maximum - scale.minimum) / scale.step))

    def rating(self, k: int) -> float:
        """The rating of a whole number of steps, a whole number as one."""
        value = self.offset + self.size * k
        return int(value) if float(value).is_integer() else round(value, 6)

    def targets(self, targets: Targets) -> Targets:
        """The same targets for ratings counted in steps; tests do not depend on the unit."""
        if (self.offset, self.size) == (0.0, 1.0):
            return targets
        return replace(
            targets,
            means=tuple(self._mean(target, self.offset) for target in targets.means),
            spreads=tuple(
                replace(s, low=s.low / self.size, high=s.high / self.size, scale=s.scale / self.size)
                for s in targets.spreads
            ),
            directions=tuple(self._mean(target, 0.0) for target in targets.directions),
        )

    def _mean(self, target: MeanTarget, offset: float) -> MeanTarget:
        low, high = (target.low - offset) / self.size, (target.high - offset) / self.size
        return replace(target, low=low, high=high, scale=target.scale / self.size)
