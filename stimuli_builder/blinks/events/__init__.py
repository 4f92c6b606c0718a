"""What the lids do in a distance series: blinks, squints, gaze shifts and closed eyes."""
