"""The coupled active appearance model: learned from a handful of labelled frames, fitted to every frame."""
