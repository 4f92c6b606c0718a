"""What the endpoints of links take and give, and how addresses are signed."""

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, Field, StringConstraints

from server.participants.recruiter import Recruiter, without_refused
from server.request_body import RequestBody
from server.studies.fields import Label


class Signing(BaseModel):
    """The study's secret for signed addresses, and how the recruiter's side signs with it."""

    declared: bool = Field(description="The recruiter declares that addresses are signed.")
    parameter: str = Field(description="Address parameter of the signature.")
    secret_name: str = Field(description="Another name makes another secret.")
    secret: str = Field(description="64 hexadecimal digits; who has it can sign for anybody.")
    identifier: str = Field(description="A participant's id, as an example.")
    signature: str = Field(description="HMAC-SHA-256 of that id, with the secret as key.")
    query: str = Field(
        description="What is added to the link after `?` for that participant, percent-encoded."
    )
    python: str = Field(description="The same signature in Python.")
    shell: str = Field(description="The same signature by OpenSSL.")


class NewLinks(RequestBody):
    """One general or preview link, or many personal ones: by their labels, or `count` numbered ones."""

    kind: Literal["general", "personal", "preview"]
    label: Label = ""
    group: Annotated[str, StringConstraints(max_length=600)] = Field(
        default="", description="Group of who comes by it, where links decide."
    )
    labels: list[Label] = Field(default=[], max_length=5000)
    count: Annotated[int, Field(ge=1, le=5000)] = 1
    quota: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    days: Annotated[int, Field(ge=1, le=3650)] | None = None
    recruiter: Annotated[Recruiter, AfterValidator(without_refused)] | None = None


class LinkOut(BaseModel):
    """A link into a study."""

    id: str
    kind: str
    label: str
    group_name: str = Field(description="Group of who comes by it; empty where links decide none.")
    url: str
    quota: int | None
    expires_at: datetime | None
    created_at: datetime
    runs: int
    complete: int
    recruiter: dict[str, Any] | None


class LinkPage(BaseModel):
    """Links in the order they were made."""

    links: list[LinkOut]
    total: int
    next: str | None = Field(description="Ask again with `after` = this; null at the end.")
