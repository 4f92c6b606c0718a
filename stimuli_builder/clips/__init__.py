"""From cells and characters to clips: curves, motion blur, encoding, manifest, checks."""
