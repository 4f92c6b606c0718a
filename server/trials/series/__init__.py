"""Adaptive series: what was answered decides what is shown next."""
