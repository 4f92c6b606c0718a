"""Whether items measure one thing (reliability), and whether people say the same (agreement)."""
