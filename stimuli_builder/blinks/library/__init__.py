"""The blink profiles that ship with the project, measured from real recordings."""

from stimuli_builder.blinks.library.load import LIBRARY_FOLDER, load_library

__all__ = ["LIBRARY_FOLDER", "load_library"]
