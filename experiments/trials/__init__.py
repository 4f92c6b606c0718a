"""The kinds of trial: a folder each."""
