"""What every body that an endpoint takes has in common."""

from pydantic import BaseModel, ConfigDict


class RequestBody(BaseModel):
    """A body with a key that is not declared is refused: a misspelled one would do nothing, unsaid."""

    model_config = ConfigDict(extra="forbid")
