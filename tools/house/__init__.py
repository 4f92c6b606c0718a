"""Measures of the tree: how many files, how they import one another, where they name a trial kind."""
