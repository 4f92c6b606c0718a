"""What a study's data say of themselves when they are handed on."""

from typing import Annotated, Self

from pydantic import StringConstraints, model_validator

from experiments.base import Declaration

Licence = Annotated[str, StringConstraints(pattern=r"^(https?://\S+|[A-Za-z0-9][A-Za-z0-9.+-]{1,60})$")]
"""An SPDX identifier such as `CC-BY-4.0`, or the address of a licence's text."""

SPDX_PAGE = "https://spdx.org/licenses/{}"


class Creator(Declaration):
    """A person or an institution that made the data."""

    name: Annotated[str, StringConstraints(min_length=1, max_length=200)]
    """Name as it is cited."""
    orcid: Annotated[str, StringConstraints(pattern=r"^\d{4}-\d{4}-\d{4}-\d{3}[\dX]$")] | None = None
    """ORCID of a person, as four groups of four digits."""
    affiliation: str = ""
    """Where the person works."""

    @property
    def orcid_page(self) -> str | None:
        """The ORCID as an address."""
        return f"https://orcid.org/{self.orcid}" if self.orcid else None


class Dataset(Declaration):
    """Who made the data and who may do what with them; stands in Psych-DS datasets and capsules."""

    creators: tuple[Creator, ...] = ()
    """Who is cited for the data, in order."""
    licence: Licence | None = None
    """Under which licence the data are handed on. Without it nobody else may use them."""
    description: str = ""
    """What the data are, in some sentences; empty takes the title."""
    keywords: tuple[str, ...] = ()
    """Words under which the data should be found, beside the factors' labels."""

    @property
    def licence_page(self) -> str | None:
        """The licence as an address."""
        if self.licence is None or self.licence.startswith("http"):
            return self.licence
        return SPDX_PAGE.format(self.licence)

    @model_validator(mode="after")
    def _each_once(self) -> Self:
        names = [creator.name for creator in self.creators]
        if repeated := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"creators: '{repeated[0]}' stands twice among them")
        return self
