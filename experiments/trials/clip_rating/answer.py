"""What a participant answers to one clip."""

from pydantic import StrictInt

from experiments.base import Declaration


class RatingAnswer(Declaration):
    """A rating; None where the clip could not be shown."""

    response: StrictInt | None
