"""What the engine needs to know of a person and a state, with defaults that each name their source."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import lru_cache
from importlib.resources import files
from typing import Any, Literal

from blink_engine.laws import Law

# What the caller passes to the engine: moments at which people tend to blink.

EventKind = Literal[
    "utterance_start", "utterance_end", "pause", "turn_end", "gaze_shift", "head_turn", "blink"
]
EVENT_KINDS: tuple[EventKind, ...] = (
    "utterance_start",
    "utterance_end",
    "pause",
    "turn_end",
    "gaze_shift",
    "head_turn",
    "blink",
)


@dataclass(frozen=True)
class Event:
    """Something that happened at `time_s`.

    `amplitude_deg` is the size of a gaze shift or head turn; other kinds ignore it. A `blink` event always
    blinks, at once.
    """

    kind: EventKind
    time_s: float
    amplitude_deg: float = 0.0

    def __post_init__(self) -> None:
        if self.kind not in EVENT_KINDS:
            raise ValueError(f"expected an event of kind {', '.join(EVENT_KINDS)}; got '{self.kind}'")
        if not math.isfinite(self.time_s) or not math.isfinite(self.amplitude_deg):
            raise ValueError(
                f"expected a finite time and amplitude, got {self.time_s} and {self.amplitude_deg}"
            )


@dataclass(frozen=True)
class Response:
    """How blinks answer events of one kind.

    `probability` of a blink, after a latency uniform between `earliest_s` and `latest_s`. Where
    `midpoint_deg` is positive, the probability grows with the size of the movement instead,
    1 / (1 + exp(-(|amplitude| - midpoint) / slope)).
    """

    probability: float
    earliest_s: float
    latest_s: float
    midpoint_deg: float = 0.0
    slope_deg: float = 1.0

    def chance(self, amplitude_deg: float) -> float:
        """Return the probability that an event of this size is answered by a blink."""
        if self.midpoint_deg <= 0.0:
            return self.probability
        return 1.0 / (1.0 + math.exp(-(abs(amplitude_deg) - self.midpoint_deg) / self.slope_deg))


StateName = Literal["rest", "reading", "screen", "speaking", "listening"]
STATE_NAMES: tuple[StateName, ...] = ("rest", "reading", "screen", "speaking", "listening")


@dataclass(frozen=True)
class ProfileModel:
    """How single blinks look.

    Attributes
    ----------
    closing_s, opening_s, closed_s, long_closed_s : Law
        Durations in s; `closed_s` for complete blinks, `long_closed_s` for long ones; partial ones have none.
    closing_power, opening_power : float
        p and q of `BlinkShape`.
    complete_share, long_share, double_share : float
        Shares of the blinks in which the lids meet, stay closed for long, or close a second time at once.
    partial_logit_median, partial_logit_spread : float
        Peak closure a of a partial blink: log(a / (1 - a)) is normal.
    asymmetry : float
        Standard deviation of the difference between the eyes' peak closures.
    delay_s : float
        Standard deviation of the right eye's onset against the left's, in s.
    lower_up, lower_in : float
        How far the lower lid goes at full closure, as a share of its full vertical and horizontal travel.
    """

    closing_s: Law
    opening_s: Law
    closed_s: Law
    long_closed_s: Law
    closing_power: float
    opening_power: float
    complete_share: float
    long_share: float
    double_share: float
    partial_logit_median: float
    partial_logit_spread: float
    asymmetry: float
    delay_s: float
    lower_up: float
    lower_in: float


# Decision 0705: Blink intervals are correlated and drift.
@dataclass(frozen=True)
class Drift:
    r"""How somebody's rate wanders: blinks come in stretches of many and of few.

    Each interval is the law's draw times e to the power of d_k, for blink k

    .. math::

        d_k = \varphi d_{k-1} + \sqrt{1 - \varphi^2}\, \sigma z_k \tag{4}

    Attributes
    ----------
    spread : float
        sigma, the standard deviation of d; z_k is standard normal. 0: no drift.
    kept : float
        phi, what is kept of d from one blink to the next, 0 to 1.
    """

    spread: float
    kept: float

    @property
    def mean(self) -> float:
        """Expected value of e to the power of d."""
        return math.exp(self.spread**2 / 2.0)

    def under_way(self, z: float) -> float:
        """Return d at a random moment, given a standard normal number: it falls into long intervals."""
        return self.spread**2 + self.spread * z

    def following(self, before: float, z: float) -> float:
        """Return d_k, given d_(k-1) and a standard normal number."""
        return self.kept * before + math.sqrt(1.0 - self.kept**2) * self.spread * z


@dataclass(frozen=True)
class Parameters:
    """Everything the engine draws by.

    Attributes
    ----------
    intervals : mapping of state to Law
        Onset to onset, in s, where the drift is 0. A `fixed` law does not drift.
    drift, slow_drift : Drift
        Over some blinks, and over minutes; both apply.
    responses : mapping of event kind to Response
    profile : ProfileModel
    least_interval_s : float
        No blink begins sooner after the one before, in s.
    gaze_closure_per_deg : float
        How much of the opening the lid covers per degree of downward gaze.
    squint_closure : float
        How much of the opening a full squint covers from above; the lower lid then is raised fully.
    """

    intervals: Mapping[StateName, Law]
    drift: Drift
    slow_drift: Drift
    responses: Mapping[EventKind, Response]
    profile: ProfileModel
    least_interval_s: float
    gaze_closure_per_deg: float
    squint_closure: float
    sources: Mapping[str, str] = field(default_factory=dict, compare=False)

    def mean_interval_s(self, state: StateName) -> float:
        """Return the mean time from onset to onset in a state, the drifts included."""
        law = self.intervals[state]
        return law.mean if law.kind == "fixed" else law.mean * self.drift.mean * self.slow_drift.mean

    def with_rate(self, state: StateName, per_minute: float) -> "Parameters":
        """Return the same with another mean blink rate in one state.

        Raises
        ------
        ValueError
            Where the rate is not between 0.1 and 60 a minute.
        """
        if not 0.1 <= per_minute <= 60.0:
            raise ValueError(f"expected a blink rate of 0.1 to 60 per minute, got {per_minute}")
        law = self.intervals[state]
        ratio = 60.0 / per_minute / self.mean_interval_s(state)
        return self.with_intervals({state: law.with_mean(law.mean * ratio)})

    def with_intervals(self, laws: Mapping[StateName, Law]) -> "Parameters":
        """Return the same with other laws of the intervals in some states."""
        return Parameters(**{**_own(self), "intervals": {**self.intervals, **laws}})

    def with_profile(self, **changes: Any) -> "Parameters":
        """Return the same with some values of the profile model changed."""
        profile = ProfileModel(**{**_own(self.profile), **changes})
        return Parameters(**{**_own(self), "profile": profile})


def _own(instance: Any) -> dict[str, Any]:
    return {one.name: getattr(instance, one.name) for one in fields(instance)}


@lru_cache(maxsize=1)
def default_parameters() -> Parameters:
    """Return the shipped defaults (`defaults.json`, written by `bench/blink_engine_fit.py`)."""
    return from_json(json.loads(files(__package__).joinpath("defaults.json").read_text(encoding="utf-8")))


def from_json(data: Mapping[str, Any]) -> Parameters:
    """Read parameters as `defaults.json` and the TypeScript engine write them."""
    profile: dict[str, Any] = {
        name: Law(**value) if isinstance(value, Mapping) else value for name, value in data["profile"].items()
    }
    return Parameters(
        intervals={state: Law(**data["intervals"][state]) for state in STATE_NAMES},
        drift=Drift(**data["drift"]),
        slow_drift=Drift(**data["slow_drift"]),
        responses={kind: Response(**data["responses"][kind]) for kind in EVENT_KINDS},
        profile=ProfileModel(**profile),
        least_interval_s=data["least_interval_s"],
        gaze_closure_per_deg=data["gaze_closure_per_deg"],
        squint_closure=data["squint_closure"],
        sources=data["sources"],
    )
