"""Recorded blinks, the blink model, characters and rendered clips: everything before the browser."""
