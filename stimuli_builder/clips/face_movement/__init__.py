"""What moves in a face beside its lids when a study declares it: brow, cheek, squint and gaze."""
