"""Any video to a clip that every browser plays frame by frame, made in a separate process."""
