"""Any video to a clip that every browser plays frame by frame: for the server and for `stimuli manifest`."""
