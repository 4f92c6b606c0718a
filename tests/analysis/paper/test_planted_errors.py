"""Statistics of published studies as printed, thirty errors planted among them, and false alarms."""

import random
import re
from dataclasses import dataclass

import pytest
from scipy import special

from analysis.paper.statistics import TextCheck, check_text

# Hughes, Hussey et al., deepfaked clips (data CC BY): Welch tests and tests against 0, as printed.
WELCH = (
    "M = 0.04, M = 0.39, t(317.27) = -9.92, p < .0001, d = -1.07, 95% CI [-1.29, -0.85]",
    "M = -1.69, M = 1.35, t(318.43) = -20.62, p < .0001, d = -2.22, 95% CI [-2.49, -1.96]",
    "M = 0.03, M = 0.4, t(212.04) = -9.3, p < .0001, d = -1.26, 95% CI [-1.55, -0.97]",
    "M = -1.65, M = 1.36, t(212.9) = -17.12, p < .0001, d = -2.31, 95% CI [-2.66, -1.97]",
    "M = 0.05, M = 0.4, t(335.69) = -11.18, p < .0001, d = -1.21, 95% CI [-1.44, -0.98]",
    "M = -1.86, M = 1.35, t(330.86) = -25.92, p < .0001, d = -2.81, 95% CI [-3.11, -2.51]",
    "M = -0.06, M = 0.39, t(200.89) = -9.93, p < .0001, d = -1.36, 95% CI [-1.66, -1.06]",
    "M = -1.58, M = -0.39, t(213.23) = -10.32, p < .0001, d = -1.38, 95% CI [-1.67, -1.08]",
)
ONE_SAMPLE = (
    "M = 0.04, t(160) = 1.43, p = .1553, d = 0.11, 95% CI [-0.04, 0.27]",
    "M = 0.39, t(196) = 17.99, p < .0001, d = 1.28, 95% CI [1.14, 1.42]",
    "M = -1.69, t(160) = -14.55, p < .0001, d = -1.15, 95% CI [-1.3, -0.99]",
    "M = 0.03, t(103) = 0.89, p = .3781, d = 0.09, 95% CI [-0.11, 0.28]",
    "M = 0.05, t(169) = 1.95, p = .0533, d = 0.15, 95% CI [0, 0.3]",
    "M = -0.06, t(100) = -1.66, p = .0992, d = -0.17, 95% CI [-0.36, 0.03]",
    "M = -0.39, t(116) = -4.35, p < .0001, d = -0.4, 95% CI [-0.58, -0.22]",
)
# Uhde et al. (2025), MobileHCI (CC BY 4.0): Kruskal-Wallis tests of four gestures, N = 281.
RANKS = (
    "χ2(3, N = 281) = 15.86, p = .001",
    "χ2(3, N = 281) = 11.00, p = .012",
    "χ2(3, N = 281) = 16.64, p < .001",
    "χ2(3, N = 281) = 5.10, p = .165",
    "χ2(3, N = 281) = 16.97, p < .001",
)
# Trutoiu et al. (2011), section 4.1.2 to 4.3.2, with the df of their designs; those that a check must accept.
EFFECTS = (
    "F(1, 31) = 0.95, p = .34",
    "F(1, 31) = 15.55, p < .001",
    "F(1, 31) = 20.35, p < .001",
    "F(1, 31) = 9.93, p = .004",
    "F(1, 31) = 5.91, p = .02",
    "F(1, 31) = 39.07, p < .001",
)
PRINTED = (*WELCH, *ONE_SAMPLE, *RANKS, *EFFECTS)


@dataclass(frozen=True)
class Statistic:
    """A statistic of random df and size, as a paper rounds it, with its p."""

    text: str
    value: float
    p: float

    @property
    def with_p(self) -> str:
        return f"{self.text}, {printed_p(self.p)}"


def printed_p(p: float) -> str:
    return "p < .001" if p < 0.001 else f"p = {p:.3f}".replace("0.", ".")


def statistic(kind: str, rng: random.Random) -> Statistic:
    """Sizes as studies have them: many p near .05."""
    a, b, u = rng.randint(1, 6), rng.randint(12, 240), rng.uniform(0.6, 4.2)
    if kind == "t":
        return Statistic(f"t({b}) = {u:.2f}", u, 2 * float(special.stdtr(b, -u)))
    if kind == "F":
        value = u**2 / a**0.5
        return Statistic(f"F({a}, {b}) = {value:.2f}", value, float(special.fdtrc(a, b, value)))
    if kind == "chi2":
        value = a + u * (2 * a) ** 0.5
        return Statistic(f"χ2({a}) = {value:.2f}", value, float(special.chdtrc(a, value)))
    if kind == "r":
        r = u / (b + u * u) ** 0.5
        return Statistic(f"r({b}) = {r:.2f}".replace("0.", "."), r, 2 * float(special.stdtr(b, -u)))
    return Statistic(f"z = {u:.2f}", u, 2 * float(special.ndtr(-u)))


def planted(rng: random.Random) -> list[str]:
    """Thirty slips of the kinds that statcheck found in papers, six of each kind of statistic."""
    slips = []
    for kind in ("t", "F", "chi2", "r", "z"):
        while len(slips) % 6 or len(slips) < 6 * (["t", "F", "chi2", "r", "z"].index(kind) + 1):
            one = statistic(kind, rng)
            if not 0.005 < one.p < 0.4:
                continue
            slip = len(slips) % 6
            wrong = {
                0: f"{one.text}, p = {one.p / 10:.4f}",  # a zero too many
                1: f"{one.text}, p = {one.p / 2 * 0.98:.4f}",  # of one side, unsaid
                2: f"{one.text}, p < {'.001' if one.p > 0.01 else '.0001'}",
                3: f"{one.text}, p = {min(0.99, one.p * 1.6 + 0.05):.3f}",  # of another test
                4: f"{one.text.split(' = ')[0]} = {one.value * 1.6:.2f}, p = {one.p:.3f}",
                5: f"{one.text}, p = {abs(one.p - 0.12) + 0.2:.2f}",
            }[slip]
            slips.append(re.sub(r"(= |< )0\.", r"\1.", wrong))
    return slips


def checked(sentences: list[str]) -> TextCheck:
    return check_text(
        " ".join(f"The effect of item {k} was tested, {text}." for k, text in enumerate(sentences))
    )


def test_statistics_of_published_studies_are_consistent() -> None:
    result = checked(list(PRINTED))
    assert result.n_checked == len(PRINTED)
    assert result.n_wrong == 0


@pytest.mark.parametrize("seed", range(5))
def test_thirty_planted_errors_are_found_among_what_strangers_printed(seed: int) -> None:
    rng = random.Random(seed)
    wrong = planted(rng)
    assert len(wrong) == 30
    sentences = [*PRINTED, *wrong]
    rng.shuffle(sentences)
    assert checked(sentences).n_wrong == 30


def test_false_alarms_are_fewer_than_one_in_a_hundred_statistics() -> None:
    """2,000 correct statistics, rounded as papers round them."""
    rng = random.Random(9)
    correct = [statistic(rng.choice(["t", "F", "chi2", "r", "z"]), rng).with_p for _ in range(2000)]
    result = checked(correct)
    assert result.n_checked == 2000
    assert result.n_wrong <= 20
