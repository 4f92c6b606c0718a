"""Companions of the ANOVA that assume less: aligned ranks, permutations, trimmed means."""
