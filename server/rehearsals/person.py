"""A simulated person: takes, seeded, what the API gives, and answers as a declared model does."""

import hashlib
import random
import uuid
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from statistics import NormalDist
from typing import Any

from pydantic import TypeAdapter

from experiments.checks import CHECK_KINDS, CheckName
from experiments.declaration.experiment import Experiment
from experiments.declaration.forms import FormField
from experiments.errors import InputError, did_you_mean
from experiments.kinds import KINDS
from experiments.kinds.threshold_grid import Point, model, points_of
from server.accounts.identity import OPERATOR
from server.core.db import Database
from server.core.settings import Settings
from server.core.values import derived_token
from server.participation.kinds import served_kind
from server.participation.versions import Versions
from server.rehearsals.http import RunApi
from server.studies.links import PURPOSE, create_link
from server.studies.lookup import active_version, find_study, must_not_be_archived
from server.studies.repository import clips_of_design

# A simulated observer with a true psychometric function, for studies that look for thresholds.


@dataclass(frozen=True)
class Truth:
    """The function P(x) = guess + (1 - guess - lapse) Phi((x - threshold) / spread), turned where it falls.

    Attributes
    ----------
    threshold, spread : float
        Mean and SD of the normal distribution, in the stimulus's unit.
    sd : float
        Spread of the thresholds of people around `threshold`.
    guess, lapse : float
        The function's ends.
    tilt : float
        With a second factor, how far the threshold moves per unit of its numbers; `threshold` is that at
        their middle.
    """

    threshold: float
    spread: float
    sd: float = 0.0
    guess: float = 0.02
    lapse: float = 0.02
    tilt: float = 0.0

    def of_person(self, rng: random.Random) -> "Truth":
        """The function of one person."""
        return replace(self, threshold=self.threshold + rng.gauss(0, self.sd))

    def probability(self, stimulus: float, *, off_middle: float = 0.0, falling: bool = False) -> float:
        """How likely the answer is yes, or right.

        Parameters
        ----------
        off_middle : float, optional
            The second number, from the middle of all.
        """
        z = (stimulus - self.threshold - self.tilt * off_middle) / self.spread
        return self.guess + (1 - self.guess - self.lapse) * NormalDist().cdf(-z if falling else z)


def truth_of(experiment: Experiment, text: str = "") -> Truth:
    """The function that `text` sets (`threshold=200,spread=30,sd=10`), with usual values for the rest.

    Where not set, the threshold lies in the middle of the stimuli and the spread is an eighth of their range.
    """
    assumed = model(experiment)
    low, high = assumed.stimuli[0], assumed.stimuli[-1]
    usual = Truth((low + high) / 2, (high - low) / 8, 0.0, assumed.guess, assumed.lapse)
    truth = replace(usual, **_settings(text))
    if not truth.spread > 0 or not truth.sd >= 0 or not 0 <= truth.guess <= 1 - truth.lapse <= 1:
        raise InputError(
            f"--observer: expected spread above 0, sd from 0, guess and lapse within 0 to 1; got {text}"
        )
    return truth


def _settings(text: str) -> dict[str, float]:
    names, settings = [field.name for field in fields(Truth)], {}
    for part in filter(None, text.split(",")):
        name, _, number = part.partition("=")
        if name.strip() not in names:
            near = did_you_mean(name.strip(), names)
            raise InputError(f"--observer: expected {', '.join(names)}, got '{name.strip()}'{near}")
        try:
            settings[name.strip()] = float(number)
        except ValueError as error:
            raise InputError(f"--observer: expected a number for {name.strip()}, got '{number}'") from error
    return settings


@dataclass(frozen=True)
class Observer:
    """Somebody who sees stimuli by their true function.

    Attributes
    ----------
    points : mapping of str to Point
        The stimulus in each clip, by hash.
    middle : float
        Of the second factor's numbers.
    """

    truth: Truth
    points: Mapping[str, Point]
    falling: bool
    middle: float = 0.0

    def of_person(self, rng: random.Random) -> "Observer":
        """One person of those this stands for."""
        return replace(self, truth=self.truth.of_person(rng))

    def sees(self, clip: str) -> float:
        """How likely they say yes to a clip, or name it rightly; nothing is to be seen in the standard."""
        if clip not in self.points:
            return 0.0
        value, second = self.points[clip]
        off_middle = 0.0 if second is None else second - self.middle
        return self.truth.probability(value, off_middle=off_middle, falling=self.falling)


def observer_of(experiment: Experiment, levels_of: Mapping[str, Mapping[str, str]], text: str) -> Observer:
    """The observers of a study of thresholds.

    Parameters
    ----------
    levels_of : mapping of str to mapping of str to str
        Levels of each clip, by hash.
    """
    assumed = model(experiment)
    return Observer(
        truth_of(experiment, text), points_of(experiment, levels_of), assumed.falling, assumed.middle
    )


# A simulated person: takes, seeded, what the API gives, and answers as a declared rater model does.

LEVEL_SD, PERSON_SD, CLIP_SD = 0.5, 0.6, 0.2
"""Spread of level effects, person means and exemplars, in points of a seven-point scale."""
FLAGGED_SHARE, FAILED_SHARE = 0.03, 0.01
"""Shares of plays with a frame lost (flagged) and with the focus lost (failed)."""


SEES_MOTION = 0.97
"""Share of motion checks whose content people see; the others they guess."""


class Rater:
    """The rater model of one person: mean of the scale + level effects + person + exemplar + noise.

    Parameters
    ----------
    seed : int
        Of this person.
    effects_seed : int
        Of the effects, shared by all people of a simulation.
    levels_of : mapping of str to mapping of str to str
        Levels of each clip by its hash; a real participant never learns them, so the effects are put in from
        outside.
    observer : Observer, optional
        Their psychometric function, in a study of thresholds.
    blinks_of : mapping of str to sequence of float, optional
        Onsets of the blinks of each performance by the clip's hash, in s.
    checks : mapping of str to int, optional
        Right answer to each motion check by its clip's hash, likewise put in from outside.
    """

    def __init__(
        self,
        seed: int,
        effects_seed: int,
        levels_of: Mapping[str, Mapping[str, str]],
        observer: Observer | None = None,
        blinks_of: Mapping[str, Sequence[float]] | None = None,
        checks: Mapping[str, int] | None = None,
    ) -> None:
        self.blinks_of = blinks_of or {}
        self.seed, self.effects_seed, self.levels_of = seed, effects_seed, levels_of
        self.checks = checks or {}
        self.rng = random.Random(f"{effects_seed}/person/{seed}")
        self.shift = self.rng.gauss(0, PERSON_SD)
        own = random.Random(f"{effects_seed}/observer/{seed}")
        self.observer = observer and observer.of_person(own)

    def __call__(self, clip: str) -> float:
        """How well this person likes a clip."""
        return self.likes(clip)

    def sees(self, clip: str) -> float:
        """How likely this person says yes to a clip, or names it rightly; a guess without an observer."""
        return self.observer.sees(clip) if self.observer else 0.5

    def blinks(self, clip: str) -> Sequence[float]:
        """When the blinks of a clip's performance begin."""
        return self.blinks_of.get(clip, ())

    def check_answer(self, trial: Mapping[str, Any], rng: random.Random, sees: float = SEES_MOTION) -> int:
        """The choice in a motion check by somebody who sees its clip with this probability, else guesses."""
        if rng.random() < sees and trial["clip_sha256"] in self.checks:
            return self.checks[trial["clip_sha256"]]
        name: CheckName = trial["check"]
        return rng.randint(1, len(CHECK_KINDS[name].choices))

    def likes(self, clip: str) -> float:
        """How well this person likes a clip: effects of levels and exemplar, and the person's own shift."""
        levels = self.levels_of.get(clip, {}).items()
        effects = sum(self._effect(f"{name}/{level}") for name, level in levels)
        return effects + self._effect(clip) * CLIP_SD / LEVEL_SD + self.shift

    def _effect(self, key: str) -> float:
        digest = hashlib.sha256(f"{self.effects_seed}/{key}".encode()).digest()
        return random.Random(digest).gauss(0, LEVEL_SD)


class Person:
    """One simulated participant on one connection."""

    def __init__(self, client: RunApi, rater: Rater, language: str | None = None) -> None:
        self.client, self.rater, self.language = client, rater, language
        self.elapsed_ms = 0.0
        self.ratings = 0
        self.following: dict[str, Any] | None = None
        self.brings_evidence = False
        self.placed: dict[str, Any] | None = None
        """The run again, if an answer decided its group."""

    def take_part(
        self, link_token: str, *, stop_after: int | None = None, progress: Callable[[], None] = lambda: None
    ) -> str | None:
        """Go through the whole run; return the code, None where `stop_after` or a screening ended it."""
        self.begin(link_token)
        state = self.client.get("/api/run")
        if not self._before(state):
            return None
        state = self.placed or state
        due = [trial for trial in state["trials"] if not trial["answered"]]
        while due:
            trial = due.pop(0)
            if stop_after is not None and self.ratings >= stop_after:
                return None
            if self.rate(trial, state["trial"]):
                self._offer_again(trial, due)
            due = still_due(due, self.following)
            progress()
        if not self._forms(state, "after"):
            return None
        self.client.put("/api/run/stage", {"stage": "debrief"})
        return str(self.client.post("/api/run/complete")["completion_code"])

    def begin(self, link_token: str) -> None:
        """Open the link and start the run."""
        link = self.client.get(f"/api/links/{link_token}")
        rng = random.Random(f"{self.rater.effects_seed}/client/{self.rater.seed}")
        client_id = uuid.UUID(int=rng.getrandbits(128), version=4)
        start = {
            "language": self.language or link["study"]["languages"][0],
            "client_id": str(client_id),
            "device": {"simulated": True},
            "evidence": self.brings_evidence,
            "view_tickets": self.brings_evidence,
        }
        self.client.token = self.client.post(f"/api/links/{link_token}/runs", start)["run_token"]

    def _before(self, state: dict[str, Any]) -> bool:
        """Up to the first trial; False where an answer screened this person out."""
        self.client.put("/api/run/consent", {"agreed": True})
        if not self._forms(state, "before"):
            return False
        if state["display"]["calibrate"] != "off":
            self.client.put("/api/run/calibration", _CALIBRATION)
        self.client.put("/api/run/stage", {"stage": "trials"})
        return True

    def _forms(self, state: dict[str, Any], when: str) -> bool:
        for form in state["forms"]:
            if form["when"] == when:
                fields = map(_FIELD.validate_python, form["fields"])
                answers = {field.name: field.simulated(self.rater.rng) for field in fields}
                saved = self.client.put(f"/api/run/forms/{form['name']}", {"answers": answers})
                if saved["status"] != "active":
                    return False
                self.placed = saved["run"] or self.placed
        return True

    def rate(self, trial: dict[str, Any], declared: dict[str, Any]) -> bool:
        """Play and rate one trial; True where the receipt asks for the clip again."""
        body = self.rating(trial, declared)
        saved = self.client.put(f"/api/run/ratings/{uuid.uuid4()}", body)
        self.ratings += 1
        self.following = saved.get("next")
        return bool(saved["receipt"]["again"])

    def rating(self, trial: dict[str, Any], declared: dict[str, Any]) -> dict[str, Any]:
        """The rating as the page would send it."""
        rng, clip = self.rater.rng, trial["clip_sha256"]
        length_ms = 1000 * _frames(trial) / trial["fps"] if clip else 0.0
        rt = rng.lognormvariate(6.5, 0.4)
        self.elapsed_ms += length_ms + rt + 500
        return {
            "trial_index": trial["trial_index"],
            "play": trial["plays_done"] + 1,
            "answer": self._answer(trial, declared),
            "rt": round(rt, 2),
            "rt_from_first_frame": round(rt + length_ms, 2),
            "time_elapsed": round(self.elapsed_ms, 2),
            "changes": 0,
            "playback": self._playback(trial) if clip else {"method": "none"},
        }

    def _answer(self, trial: dict[str, Any], declared: dict[str, Any]) -> dict[str, Any]:
        if trial["kind"] == "check":
            return {"kind": "check", "check": self.rater.check_answer(trial, self.rater.rng)}
        return served_kind(declared["kind"]).simulated(self.rater, trial, declared, self.rater.rng)

    def _playback(self, trial: dict[str, Any]) -> dict[str, Any]:
        rng, frames = self.rater.rng, _frames(trial)
        chance, period = rng.random(), 1000 / trial["fps"]
        lost = {rng.randrange(1, frames)} if chance < FLAGGED_SHARE and frames > 1 else set()
        drawn = [[index, round(10 + index * period, 2)] for index in range(frames) if index not in lost]
        return {
            "method": "webcodecs",
            "clip_sha256": trial["clip_sha256"],
            "clips": _each_clip(trial, lost),
            "key_to_first_frame_ms": round(rng.uniform(6, 20), 2),
            "frames_drawn": len(drawn),
            "frames_late": 0,
            "frames_missing": len(lost),
            "longest_gap_ms": round(period * (2 if lost else 1), 2),
            "clock_gap_ms": round(rng.uniform(16.8, 18), 2),
            "clock_late_ms": round(rng.uniform(0.2, 1.5), 2),
            "stalls": 0,
            "focus_lost": int(chance > 1 - FAILED_SHARE),
            "refresh_rate_hz": 60.0,
            "device_pixel_ratio": 1.0,
            "drawn": drawn,
        }

    @staticmethod
    def _offer_again(trial: dict[str, Any], due: list[dict[str, Any]]) -> None:
        """Put the trial at the end of its block."""
        position = sum(1 for other in due if other["block"] == trial["block"])
        due.insert(position, {**trial, "plays_done": trial["plays_done"] + 1})


def still_due(due: list[dict[str, Any]], following: dict[str, Any] | None) -> list[dict[str, Any]]:
    """The trials due as the server has chosen them again, without those of ended series."""
    if following is None:
        return due
    anew = {trial["trial_index"]: trial for trial in following["trials"]}
    return [
        anew.get(trial["trial_index"], trial)
        for trial in due
        if trial["plays_done"] or trial["trial_index"] not in following["closed"]
    ]


def _frames(trial: dict[str, Any]) -> int:
    """Frames that one showing draws: clips at once are drawn together, those in turn one after the other."""
    frames = [int(clip["frames"]) for clip in trial["clips"] if clip["role"] != "reference"]
    before = sum(int(clip["frames"]) for clip in trial["clips"] if clip["role"] == "reference")
    in_turn = any(clip["role"] == "first" for clip in trial["clips"])
    return before + (sum(frames) if in_turn else max(frames))


def view_s(trial: dict[str, Any], declared: dict[str, Any]) -> float:
    """How long the clips of one play last, in s: as often as they are shown, the gaps between them too."""
    roles = {clip["role"] for clip in trial["clips"]}
    if not roles:
        return 0.0
    gap_ms = declared["reference"]["gap_ms"] if "reference" in roles else 0
    if "first" in roles:
        gap_ms += declared.get("presentation", declared)["gap_ms"]
    views = 1 if trial["kind"] == "check" else declared.get("views", 1)
    return float(views * _frames(trial) / trial["fps"] + gap_ms / 1000)


def _each_clip(trial: dict[str, Any], lost: set[int]) -> dict[str, Any] | None:
    if len(trial["clips"]) < 2:
        return None
    return {
        clip["role"]: {
            "clip_sha256": clip["clip_sha256"],
            "frames_drawn": clip["frames"] - sum(frame < clip["frames"] for frame in lost),
            "frames_missing": sum(frame < clip["frames"] for frame in lost),
        }
        for clip in trial["clips"]
    }


_FIELD: TypeAdapter[FormField] = TypeAdapter(FormField)
_CALIBRATION = {
    "px_per_mm": 3.78,
    "method": "card",
    "viewing_distance_mm": None,
    "device_pixel_ratio": 1.0,
    "screen_width_px": 1920,
    "screen_height_px": 1080,
    "window_width_px": 1920,
    "window_height_px": 1080,
    "zoom": 1.0,
}


# Who takes part in a simulation: a separate link, and raters who know the levels of every clip.


def link_and_raters(
    database: Database, settings: Settings, versions: Versions, name: str, observed: str = "", group: str = ""
) -> tuple[str, Callable[[int, int], Rater]]:
    """The token of a new link whose runs are simulated, and the maker of raters (by their number and a seed).

    Parameters
    ----------
    observed : str, optional
        The true function of a study of thresholds, as `server simulate --observer` takes it.
    group : str, optional
        Group of the link, where links decide on groups.
    """
    with database.write() as session:
        study = find_study(session, name, OPERATOR, "view")
        must_not_be_archived(study)
        version = active_version(session, study)
        rows = clips_of_design(session, version)
        blinks: dict[str, list[float]] = {row.clip_sha256: row.blinks_s or [] for row in rows}
        levels: dict[str, dict[str, str]] = {row.clip_sha256: row.levels for row in rows}
        link = create_link(
            session,
            settings.key,
            study,
            "general",
            label="simulation",
            synthetic=True,
            group_name=group,
        )
        experiment, observer = versions.get(session, version.id).experiment, None
        if KINDS[experiment.trial.kind].adapts:
            observer = observer_of(experiment, levels, observed)
        elif observed:
            raise InputError(f"--observer: expected a study of thresholds, got {experiment.trial.kind}")
        checks = {check["sha256"]: check["answer"] for check in version.manifest.get("checks", ())}
        token = derived_token(settings.key, PURPOSE, link.public_id)
    return token, lambda number, seed: Rater(number, seed, levels, observer, blinks, checks)
