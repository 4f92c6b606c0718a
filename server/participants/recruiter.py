"""Where participants come from and go back to: Prolific, SONA, MTurk, or any other address.

A study's (or link's) `recruiter` is an object with these keys, all but `kind` optional:
kind: prolific, sona, mturk or generic. id_parameter: which address parameter names the participant.
redirect_url: where to go at the end; {code}, {run} and {any address parameter} are filled in.
code_complete, code_failed_check, code_screened_out: completion codes; one is made for each run where absent.
"""

from collections.abc import Mapping
from typing import Annotated, Literal
from urllib.parse import quote

from pydantic import BaseModel, ConfigDict, StringConstraints

Code = Annotated[str, StringConstraints(max_length=100)]
ID_PARAMETERS = {
    "prolific": "PROLIFIC_PID",
    "sona": "survey_code",
    "mturk": "workerId",
    "generic": "participant",
}
PROLIFIC_URL = "https://app.prolific.com/submissions/complete?cc={code}"


class Recruiter(BaseModel):
    """How a recruiter sends participants and takes them back; see the module for each key."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    kind: Literal["prolific", "sona", "mturk", "generic"] = "generic"
    id_parameter: Code = ""
    redirect_url: Annotated[str, StringConstraints(max_length=1000, pattern=r"^(https?://.*)?$")] = ""
    code_complete: Code = ""
    code_failed_check: Code = ""
    code_screened_out: Code = ""

    def participant(self, parameters: Mapping[str, str]) -> str | None:
        """The participant's id among the address parameters; None where it is not there."""
        return parameters.get(self.id_parameter or ID_PARAMETERS[self.kind]) or None

    def code(self, outcome: Literal["complete", "failed_check", "screened_out"], own: str) -> str:
        """The declared code of this outcome, or the run's own."""
        declared = {
            "complete": self.code_complete,
            "failed_check": self.code_failed_check or self.code_complete,
            "screened_out": self.code_screened_out,
        }
        return declared[outcome] or own

    def redirect(self, code: str, run: str, parameters: Mapping[str, str]) -> str | None:
        """The address to go to with this code; None where there is none."""
        address = self.redirect_url or (PROLIFIC_URL if self.kind == "prolific" else "")
        if not address:
            return None
        for name, value in {**parameters, "code": code, "run": run}.items():
            address = address.replace("{" + name + "}", quote(value, safe=""))
        return address


NO_RECRUITER = Recruiter()
