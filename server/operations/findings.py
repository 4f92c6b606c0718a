"""What a check of `server doctor` says."""

from dataclasses import dataclass
from typing import Literal

Verdict = Literal["ok", "warning", "failed"]


@dataclass(frozen=True)
class Finding:
    """One line of the doctor: what was looked at, how it is, what was found, what to do."""

    subject: str
    verdict: Verdict
    state: str
    advice: str = ""
