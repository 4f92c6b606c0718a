"""The blink profiles that ship with the project, measured from real recordings."""

from stimuli_builder.blinks.library.load import load_library
from stimuli_builder.blinks.library.recordings import LIBRARY_FOLDER

__all__ = ["LIBRARY_FOLDER", "load_library"]
