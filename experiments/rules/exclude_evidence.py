"""Exclusion by the verdict on whether a person answered."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from experiments.rules.exclusion import LeavesOutRuns, RunTrials, Source

EvidenceVerdict = Literal["unlikely", "unclear", "not_judged"]


class ExcludeEvidence(LeavesOutRuns):
    """Leave out runs by the verdict on whether a person answered (docs/evidence.md)."""

    rule: Literal["evidence_verdict"] = "evidence_verdict"
    """Names this rule."""
    verdicts: Annotated[tuple[EvidenceVerdict, ...], Field(min_length=1)] = ("unlikely",)
    """Verdicts that leave a run out. Assistive technology can be `unclear`; runs of pages that brought no
    evidence are `not_judged`."""
    needed: ClassVar[tuple[str, ...]] = ("evidence_verdict",)
    source: ClassVar[Source] = "rows"

    def excludes(self, run: RunTrials) -> str | None:
        """The verdict."""
        verdict = run.texts("evidence_verdict")[0] or "not_judged"
        return verdict.replace("_", " ") if verdict in self.verdicts else None
