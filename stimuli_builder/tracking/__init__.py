"""The coupled active appearance model: learned from a handful of labeled frames, fitted to every frame."""
