"""Synthetic training data: pictures of faces with labels read off their geometry."""
