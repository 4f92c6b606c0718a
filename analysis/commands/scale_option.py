"""The option `--scale 1:7`, which several commands take."""

from experiments.errors import InputError


def scale_bounds(text: str | None) -> tuple[float, float] | None:
    """The ends of a scale; None where none was given."""
    if text is None:
        return None
    low, _, high = text.partition(":")
    try:
        bounds = float(low), float(high)
    except ValueError:
        bounds = (1.0, 0.0)
    if not bounds[0] < bounds[1]:
        raise InputError(f"--scale should be like 1:7, got '{text}'")
    return bounds
