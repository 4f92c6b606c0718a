"""A sealed plan: design, exclusions, analysis and power as fixed before the first participant.

The hash of the file proves that nothing in it was changed. A report compared with it lists all deviations.
"""

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal

from pydantic import ValidationError

from experiments.declaration.base import Declaration
from experiments.declaration.experiment import Experiment
from experiments.errors import InputError
from experiments.load import load_stored
from experiments.manifest import Sha256
from experiments.schema.difference import difference

OF_PAGES = ("texts", "title", "participant_title", "languages", "source", "dataset", "version")
"""Keys whose change is not a deviation from a plan: page texts and metadata of the data."""


class Seal(Declaration):
    """The sealed file."""

    format: Literal[1] = 1
    """Format of this file."""
    study: str
    """Name of the study."""
    version: int
    """Version of the sealed study."""
    sealed_at: str
    """Time of sealing (UTC, ISO 8601), by the server's clock."""
    definition: dict[str, Any]
    """The whole declaration: design, scales, exclusions, analysis plan, number of participants."""
    definition_format: int
    """Format of that declaration."""
    definition_sha256: Sha256
    """Hash of that declaration, as stored with every answer."""
    clips_sha256: Sha256
    """Hash over the clips' own hashes, in order of cells and exemplars."""
    power: dict[str, Any] | None = None
    """Earlier result of `analysis power --json`; null if power was not computed."""

    @property
    def sha256(self) -> str:
        """Hash over everything in the file."""
        text = json.dumps(self.model_dump(mode="json"), sort_keys=True, ensure_ascii=False)
        return hashlib.sha256(text.encode()).hexdigest()

    @property
    def experiment(self) -> Experiment:
        """The declared experiment."""
        return load_stored(self.definition, self.definition_format)

    def text(self) -> str:
        """The file, including its own hash."""
        return (
            json.dumps(self.model_dump(mode="json") | {"sha256": self.sha256}, indent=1, ensure_ascii=False)
            + "\n"
        )


def read_seal(path: Path) -> Seal:
    """Read a sealed plan; InputError if there is none, or if it was changed."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        own = data.pop("sha256", None)
        seal = Seal.model_validate(data)
    except OSError as error:
        raise InputError(f"{path}: expected a sealed plan (JSON), found none ({error.strerror})") from error
    except (ValidationError, ValueError, AttributeError, RecursionError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(
            f"{path.name}: expected a sealed plan as `server seal` writes it ({reason})"
        ) from error
    if own != seal.sha256:
        raise InputError(
            f"{path.name}: the seal is broken: the content does not match its own hash; use the original file"
        )
    return seal


SealedClip = tuple[str, int, str]
"""Cell, exemplar and SHA-256 of a clip."""


def clips_sha256(clips: Iterable[SealedClip]) -> str:
    """Hash over the clips' own hashes, in order of cells and exemplars."""
    return hashlib.sha256("\n".join(map(str, sorted(clips))).encode()).hexdigest()


def read_clips_sha256(path: Path) -> str:
    """`clips_sha256` of the clips in a manifest; InputError if the file is not a manifest.

    Only this part is read, because the manifest in a capsule lacks the answers to motion checks.
    """
    try:
        clips = json.loads(path.read_text(encoding="utf-8"))["clips"]
        return clips_sha256((str(one["cell"]), int(one["exemplar"]), str(one["sha256"])) for one in clips)
    except OSError as error:
        raise InputError(f"{path}: expected a manifest of clips, found none ({error.strerror})") from error
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(f"{path.name}: expected a manifest of clips as `stimuli build` writes it") from error


def deviations(seal: Seal, experiment: Experiment, participants: int, clips: str | None = None) -> list[str]:
    """What was declared or done differently than sealed, one line each.

    Parameters
    ----------
    participants : int
        Number of analyzed participants.
    clips : str, optional
        Hash of the clips that were shown (`clips_sha256`); None if it is unknown.
    """
    changes = difference(seal.experiment, experiment)
    lines = [str(change) for change in changes if change.path.split(".")[0] not in OF_PAGES]
    planned = seal.experiment.participants
    if participants != planned:
        lines.append(f"{planned} participants were planned, {participants} are analyzed")
    if clips is not None and clips != seal.clips_sha256:
        lines.append(
            f"the clips shown differ from the sealed clips (sha256 {clips[:12]}..., sealed "
            f"{seal.clips_sha256[:12]}...)"
        )
    return lines


def deviations_said(
    seal: Seal, experiment: Experiment, participants: int, clips: str | None = None
) -> tuple[str, ...]:
    """The lines of a report about the plan it is compared with."""
    plan = f"the plan sealed {seal.sealed_at} (sha256 {seal.sha256[:12]}...)"
    departures = deviations(seal, experiment, participants, clips)
    return tuple(f"deviation from {plan}: {line}" for line in departures) or (
        f"no deviation from {plan}" + ("" if clips else "; its clips were not compared"),
    )
