"""The engine's random numbers: one 32-bit integer generator, the same in every language.

The generator is xoshiro128** 1.1 (Blackman & Vigna 2021, ACM Transactions on Mathematical Software 47(4),
36), its state filled by SplitMix32: both need 32-bit integers alone, so that a page in a browser and this
module draw the same numbers to the last bit. docs/blink-engine.md specifies every step.
"""

from dataclasses import dataclass

from blink_engine.normal import normal_quantile

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
        self.state = (self.state + GOLDEN_GAMMA) & MASK
        mixed = self.state
        mixed = ((mixed ^ (mixed >> 16)) * 0x21F0AAAD) & MASK
        mixed = ((mixed ^ (mixed >> 15)) * 0x735A2D97) & MASK
        return mixed ^ (mixed >> 15)


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
        filler = SplitMix32((seed ^ (stream * 0x85EBCA6B)) & MASK)
        self._state = [filler.next() for _ in range(4)]

    def integer(self) -> int:
        """Return the next integer in [0, 2**32)."""
        s = self._state
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
