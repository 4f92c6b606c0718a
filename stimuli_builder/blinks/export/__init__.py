"""Animation curves for other programs."""
