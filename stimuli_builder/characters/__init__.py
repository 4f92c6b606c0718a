"""Characters: anything that can show an eye region at a given eyelid closure."""
