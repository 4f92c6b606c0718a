"""What a study is: the tables of its TOML, its forms, rules and kinds of trial, as frozen data."""

# Whether declarations read the descriptions of their keys, as schemas and references need them. This module
# imports nothing, so that a command can say so before it imports anything else.

_left_out = False


def descriptions_are_read() -> bool:
    """Return False once `leave_descriptions_out` was called."""
    return not _left_out


def leave_descriptions_out() -> None:
    """Do not read them, for a program that writes no schema and no reference.

    They are read from the sources as the models are made, which is a tenth of what a study's tables take.
    To be called before `experiments.declaration.base` is imported; models made before keep theirs.
    """
    global _left_out
    _left_out = True
