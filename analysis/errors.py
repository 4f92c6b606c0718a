"""Failures of the analysis that are nobody's fault."""

from experiments.errors import InputError


class NoRatingsError(InputError):
    """There is nothing to analyse (yet): an empty study, not a fault. Commands end with exit code 1."""
