"""Which shape keys or bones of a rig close the eyes, guessed by their names."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

Kind = Literal["SHAPE_KEY", "BONE"]


@dataclass(frozen=True)
class Scheme:
    """The names that one kind of rig gives to what closes the left and the right eye."""

    title: str
    kind: Kind
    left: str
    right: str


@dataclass(frozen=True)
class Guess:
    """Names that are there in a rig, and the scheme they follow; `left == right` closes both eyes at once."""

    title: str
    kind: Kind
    left: str
    right: str


SCHEMES: tuple[Scheme, ...] = (
    Scheme("ARKit", "SHAPE_KEY", "eyeBlinkLeft", "eyeBlinkRight"),
    Scheme("ARKit", "SHAPE_KEY", "eyeBlink_L", "eyeBlink_R"),
    Scheme("VRM 1", "SHAPE_KEY", "blinkLeft", "blinkRight"),
    Scheme("VRM (VRoid)", "SHAPE_KEY", "Fcl_EYE_Close_L", "Fcl_EYE_Close_R"),
    Scheme("VRM 0", "SHAPE_KEY", "Blink_L", "Blink_R"),
    Scheme("MetaHuman", "SHAPE_KEY", "CTRL_expressions_eyeBlinkL", "CTRL_expressions_eyeBlinkR"),
    Scheme("MetaHuman", "SHAPE_KEY", "eye_blink_L", "eye_blink_R"),
    Scheme("Character Creator", "SHAPE_KEY", "Eye_Blink_L", "Eye_Blink_R"),
    Scheme("Daz Genesis", "SHAPE_KEY", "eCTRLEyesClosedL", "eCTRLEyesClosedR"),
    Scheme("MakeHuman", "SHAPE_KEY", "eye-left-closure", "eye-right-closure"),
    Scheme("Rigify", "BONE", "lid.T.L.002", "lid.T.R.002"),
    Scheme("MetaHuman", "BONE", "FACIAL_L_EyelidUpperA", "FACIAL_R_EyelidUpperA"),
    Scheme("MakeHuman", "BONE", "orbicularis03.L", "orbicularis03.R"),
)

_CLOSES = re.compile(r"blink|wink|(eye|lid)s?.*(clos|shut)|(clos|shut).*(eye|lid)", re.IGNORECASE)
_LID_BONE = re.compile(r"(eye)?lid", re.IGNORECASE)
_SPEAKS_OF_LIDS: dict[Kind, re.Pattern[str]] = {"SHAPE_KEY": _CLOSES, "BONE": _LID_BONE}
_NOT_UPPER = re.compile(r"(^|[._ -])b([._ -]|$)|lower|bottom|low", re.IGNORECASE)
_SIDE = re.compile(r"left|right|(?<=[._ \-a-z])[LR](?![a-zA-Z])|(?<=[._ -])[lr](?![a-zA-Z])", re.ASCII)


def guesses(shape_keys: Iterable[str], bones: Iterable[str]) -> list[Guess]:
    """Every pair of names that may close the eyes, the likeliest first.

    Names of known schemes come first, also with a prefix as `head_lod0_mesh__` in front or in another case;
    then pairs of names that speak of closing and differ in their side only; then single shapes of both eyes.
    """
    named: dict[Kind, list[str]] = {"SHAPE_KEY": list(shape_keys), "BONE": list(bones)}
    # The longest names first: `..._eye_blink_L` follows MetaHuman, though it ends in VRM's `Blink_L` too.
    schemes = sorted(SCHEMES, key=lambda scheme: -len(scheme.left))
    every = [guess for scheme in schemes if (guess := _following(scheme, named[scheme.kind]))]
    for kind, pattern in _SPEAKS_OF_LIDS.items():
        every += _pairs(kind, [name for name in named[kind] if pattern.search(name)])
    every += [
        Guess("both eyes by one shape", "SHAPE_KEY", name, name)
        for name in named["SHAPE_KEY"]
        if _CLOSES.search(name) and _side(name) is None
    ]
    first: dict[tuple[Kind, str, str], Guess] = {}
    for guess in every:
        first.setdefault((guess.kind, guess.left, guess.right), guess)
    return sorted(first.values(), key=lambda guess: guess.kind == "BONE")


def _following(scheme: Scheme, names: Sequence[str]) -> Guess | None:
    left, right = (
        next((name for name in names if name.lower().endswith(name_of_side.lower())), None)
        for name_of_side in (scheme.left, scheme.right)
    )
    return Guess(scheme.title, scheme.kind, left, right) if left and right else None


def _pairs(kind: Kind, names: Sequence[str]) -> list[Guess]:
    """Names that are equal but for their side, upper lids only."""
    by_rest: dict[str, dict[str, str]] = {}
    for name in names:
        side = _side(name)
        if side is not None and not _NOT_UPPER.search(name):
            by_rest.setdefault(_SIDE.sub("*", _lowered_sides(name)).lower(), {})[side] = name
    return [
        Guess("by name", kind, sides["left"], sides["right"]) for sides in by_rest.values() if len(sides) == 2
    ]


def _side(name: str) -> Literal["left", "right"] | None:
    sides = {side[0].lower() for side in _SIDE.findall(_lowered_sides(name))}
    if len(sides) != 1:
        return None
    return "left" if sides == {"l"} else "right"


def _lowered_sides(name: str) -> str:
    return re.sub(r"left|right", lambda word: word.group().lower(), name, flags=re.IGNORECASE)
