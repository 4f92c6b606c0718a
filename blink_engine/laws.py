"""The distributions the engine draws from, and its random numbers, the same in every language."""

import math
from dataclasses import dataclass
from typing import Literal

# The quantile of the normal distribution, by rational functions that every language computes alike.

# Coefficients of algorithm AS 241 (PPND16), Wichura (1988), Applied Statistics 37(3), 477-484.
_A = (
    3.3871328727963666080e0,
    1.3314166789178437745e2,
    1.9715909503065514427e3,
    1.3731693765509461125e4,
    4.5921953931549871457e4,
    6.7265770927008700853e4,
    3.3430575583588128105e4,
    2.5090809287301226727e3,
)
_B = (
    1.0,
    4.2313330701600911252e1,
    6.8718700749205790830e2,
    5.3941960214247511077e3,
    2.1213794301586595867e4,
    3.9307895800092710610e4,
    2.8729085735721942674e4,
    5.2264952788528545610e3,
)
_C = (
    1.42343711074968357734e0,
    4.63033784615654529590e0,
    5.76949722146069140550e0,
    3.64784832476320460504e0,
    1.27045825245236838258e0,
    2.41780725177450611770e-1,
    2.27238449892691845833e-2,
    7.74545014278341407640e-4,
)
_D = (
    1.0,
    2.05319162663775882187e0,
    1.67638483018380384940e0,
    6.89767334985100004550e-1,
    1.48103976427480074590e-1,
    1.51986665636164571966e-2,
    5.47593808499534494600e-4,
    1.05075007164441684324e-9,
)
_E = (
    6.65790464350110377720e0,
    5.46378491116411436990e0,
    1.78482653991729133580e0,
    2.96560571828504891230e-1,
    2.65321895265761230930e-2,
    1.24266094738807843860e-3,
    2.71155556874348757815e-5,
    2.01033439929228813265e-7,
)
_F = (
    1.0,
    5.99832206555887937690e-1,
    1.36929880922735805310e-1,
    1.48753612908506148525e-2,
    7.86869131145613259100e-4,
    1.84631831751005468180e-5,
    1.42151175831644588870e-7,
    2.04426310338993978564e-15,
)


def normal_quantile(probability: float) -> float:
    """Return the standard normal quantile, to about 1e-15.

    Parameters
    ----------
    probability : float
        Between 0 and 1, neither of them.

    Raises
    ------
    ValueError
        Outside (0, 1).
    """
    if not 0.0 < probability < 1.0:
        raise ValueError(f"expected a probability between 0 and 1, got {probability}")
    centred = probability - 0.5
    if abs(centred) <= 0.425:
        square = 0.180625 - centred * centred
        return centred * _horner(_A, square) / _horner(_B, square)
    tail = math.sqrt(-math.log(min(probability, 1.0 - probability)))
    if tail <= 5.0:
        size = _horner(_C, tail - 1.6) / _horner(_D, tail - 1.6)
    else:
        size = _horner(_E, tail - 5.0) / _horner(_F, tail - 5.0)
    return math.copysign(size, centred)


def _horner(coefficients: tuple[float, ...], x: float) -> float:
    value = 0.0
    for coefficient in reversed(coefficients):
        value = value * x + coefficient
    return value


# The engine's random numbers: one 32-bit integer generator, the same in every language.
#
# The generator is xoshiro128** 1.1 (Blackman & Vigna 2021, ACM Transactions on Mathematical Software 47(4),
# 36), its state filled by SplitMix32: both need 32-bit integers alone, so that a page in a browser and this
# module draw the same numbers to the last bit. docs/explanation/blink-engine.md specifies every step.

MASK = 0xFFFFFFFF
GOLDEN_GAMMA = 0x9E3779B9
TWO_TO_26, TWO_TO_52 = 67108864.0, 4503599627370496.0


def _rotate_left(value: int, bits: int) -> int:
    return ((value << bits) | (value >> (32 - bits))) & MASK


@dataclass
class SplitMix32:
    """Fills a generator's state from one 32-bit seed; never all zero for four successive outputs."""

    state: int

    def next(self) -> int:
        """Return the next 32-bit integer."""
        # An odd constant: the state runs through all 2^32 values before it repeats.
        self.state = (self.state + GOLDEN_GAMMA) & MASK
        mixed = self.state
        mixed = ((mixed ^ (mixed >> 16)) * 0x21F0AAAD) & MASK
        mixed = ((mixed ^ (mixed >> 15)) * 0x735A2D97) & MASK
        return mixed ^ (mixed >> 15)


# Decision 0380: One blink engine in Python and TypeScript.
class RandomNumbers:
    """A seeded stream of numbers; streams of one seed with different numbers are independent.

    Parameters
    ----------
    seed : int
        Any integer; its lowest 32 bits count.
    stream : int
        Number of the stream, so that what is drawn for one purpose never shifts another.
    """

    def __init__(self, seed: int, stream: int = 0) -> None:
        # Spread by an odd multiplier, else the streams of neighboring seeds would be one another's.
        filler = SplitMix32((seed ^ (stream * 0x85EBCA6B)) & MASK)
        self._state = [filler.next() for _ in range(4)]

    def integer(self) -> int:
        """Return the next integer in [0, 2**32)."""
        s = self._state
        # Python's integers have no width: every product is cut to the 32 bits that `Math.imul` keeps in the
        # page.
        result = (_rotate_left((s[1] * 5) & MASK, 7) * 9) & MASK
        shifted = (s[1] << 9) & MASK
        s[2] ^= s[0]
        s[3] ^= s[1]
        s[1] ^= s[2]
        s[0] ^= s[3]
        s[2] ^= shifted
        s[3] = _rotate_left(s[3], 11)
        return result

    def uniform(self) -> float:
        """Return a number in the open interval (0, 1), of 52 random bits, from two integers.

        With 53 bits the greatest would round to 1, which has no quantile.
        """
        high, low = self.integer() >> 6, self.integer() >> 6
        return (high * TWO_TO_26 + low + 0.5) / TWO_TO_52

    def normal(self) -> float:
        """Return a standard normal deviate: the quantile of one uniform number."""
        return normal_quantile(self.uniform())


# The distributions the engine draws from, each from the numbers of one stream.


@dataclass(frozen=True)
class Law:
    """A distribution of positive numbers.

    Attributes
    ----------
    kind : {"lognormal", "gamma", "fixed"}
        `lognormal`: exp(log(median) + spread z), z standard normal. `gamma`: shape `spread`, scaled
        so that the median is about `median` (Wilson-Hilferty). `fixed`: always `median`.
    median : float
        In the unit of what is drawn.
    spread : float
        Standard deviation of the logarithm, or the gamma shape.
    """

    kind: Literal["lognormal", "gamma", "fixed"]
    median: float
    spread: float = 0.0

    def draw(self, numbers: RandomNumbers) -> float:
        """Draw one number; a log-normal and a fixed law use one uniform number, a gamma two or more."""
        if self.kind == "gamma":
            return self._scale() * _gamma(self.spread, numbers)
        # Drawn for a fixed law too: a law may be changed without shifting the numbers of what follows.
        z = numbers.normal()
        return self.median if self.kind == "fixed" else self.median * math.exp(self.spread * z)

    def draw_under_way(self, numbers: RandomNumbers) -> float:
        """Draw the interval that a random moment falls into: the longer one is, the likelier it is met.

        Its density is x f(x) / mean. A log-normal's is log-normal with the median exp(spread^2) times as
        great, a gamma's a gamma of the same scale and a shape greater by 1.
        """
        if self.kind == "gamma":
            return self._scale() * _gamma(self.spread + 1.0, numbers)
        drawn = self.draw(numbers)
        return drawn if self.kind == "fixed" else drawn * math.exp(self.spread**2)

    @property
    def mean(self) -> float:
        """Expected value."""
        if self.kind == "gamma":
            return self._scale() * self.spread
        return self.median * math.exp(self.spread**2 / 2) if self.kind == "lognormal" else self.median

    def _scale(self) -> float:
        shape = self.spread
        return self.median / (shape * (1.0 - 1.0 / (9.0 * shape)) ** 3)

    def with_mean(self, mean: float) -> "Law":
        """Return the law of the same spread whose mean is `mean`."""
        return Law(self.kind, self.median * mean / self.mean, self.spread)


def _gamma(shape: float, numbers: RandomNumbers) -> float:
    """Draw from the gamma law of scale 1 by Marsaglia & Tsang (2000), ACM TOMS 26(3), 363-372."""
    # Their method needs a shape of 1 or more; a smaller one is reached by a power of a uniform number.
    if shape < 1.0:
        boost = math.pow(numbers.uniform(), 1.0 / shape)
        return boost * _gamma(shape + 1.0, numbers)
    d = shape - 1.0 / 3.0
    c = 1.0 / math.sqrt(9.0 * d)
    while True:
        x, u = numbers.normal(), numbers.uniform()
        # Wilson and Hilferty's cube: near enough to gamma that more than 95 % of the tries are kept.
        v = (1.0 + c * x) ** 3
        if v > 0.0 and math.log(u) < 0.5 * x * x + d - d * v + d * math.log(v):
            return d * v
