"""Paired comparisons: abilities of items from which of two was preferred."""
