"""What pages measure of clips and views: bounded numbers and names."""

from typing import Annotated, Literal

from pydantic import Field, StringConstraints

Milliseconds = Annotated[float, Field(ge=0, le=1e10, allow_inf_nan=False)]
Count = Annotated[int, Field(ge=0, le=1_000_000)]
FrameTime = tuple[
    Annotated[int, Field(ge=0, le=1_000_000)], Annotated[float, Field(ge=-1e10, le=1e10, allow_inf_nan=False)]
]


Role = Literal["shown", "left", "right", "first", "second", "reference"]
DisturbanceCounts = Annotated[
    dict[Annotated[str, StringConstraints(pattern=r"^[a-z_]{1,40}$")], Count], Field(max_length=20)
]
