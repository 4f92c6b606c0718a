"""From an inter-eyelid distance series to blink profiles, the PCA blink model and animation curves."""
