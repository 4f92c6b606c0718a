"""Fields that several bodies of the study endpoints have."""

from typing import Annotated

from pydantic import Field, StringConstraints

StudyName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,59}$")]
TomlText = Annotated[str, StringConstraints(max_length=500_000)]
Label = Annotated[str, StringConstraints(strip_whitespace=True, max_length=200)]
Revision = Annotated[int, Field(ge=1, le=2**31 - 1, description="The revision this edit started from.")]
