"""The check that numbers and points of a scale share."""


def whole_number(value: object, minimum: int, maximum: int) -> str | None:
    """What is wrong with `value` as a whole number within limits; None where nothing is."""
    fits = isinstance(value, int) and not isinstance(value, bool) and minimum <= value <= maximum
    return None if fits else f"expected a whole number from {minimum} to {maximum}, got {value!r}"
