"""Builds the Blender add-on, and the pages that open from a folder: the blink engine carried elsewhere."""
