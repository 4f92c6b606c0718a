"""Eyes and lids found without labels."""
