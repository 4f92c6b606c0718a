"""Thresholds: psychometric functions of a stimulus, by person and over people."""
