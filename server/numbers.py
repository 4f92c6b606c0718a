"""Numbers that people send: as large as the columns that hold them."""

from typing import Annotated

from pydantic import Field

Number = Annotated[int, Field(ge=1, le=2**31 - 1)]
"""Number of a version, of a data series, of a row: from 1 to what an integer column of PostgreSQL holds."""
